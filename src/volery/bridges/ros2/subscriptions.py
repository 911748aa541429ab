"""Subscriptions of a program in a ROS 2 graph, adapted to their publishers' profiles."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from volery.bridges.ros2.middleware import DEFAULT_DEPTH, Handle, Participant, Profile, TopicSpec
from volery.bridges.ros2.names import NodeName
from volery.bridges.ros2.warning_filter import WarningFilter
from volery.core.errors import GraphError
from volery.graph.codecs.cdr import decode_cdr
from volery.graph.messages import Published
from volery.graph.subscription_queue import SubscriptionQueue, SubscriptionQueueInfo


class Subscriptions:
    """Queues and their ROS 2 subscriptions. Safe to use from several threads."""

    def __init__(self, participant: Participant, node: NodeName) -> None:
        self._participant = participant
        self._node = node
        self._inlets: dict[SubscriptionQueue, _Inlet] = {}
        self._warnings = WarningFilter()
        self._lock = threading.RLock()
        self._closed = False

    @property
    def infos(self) -> tuple[SubscriptionQueueInfo, ...]:
        """State of the subscriptions."""
        with self._lock:
            return tuple(queue.info for queue in self._inlets)

    def open(self, queue: SubscriptionQueue, msgtype: str, depth: int) -> None:
        """Subscribes for a queue."""
        receive = self._receiver(queue, msgtype)
        with self._lock:
            inlet = _Inlet(queue.topic, msgtype, max(depth, DEFAULT_DEPTH), receive)
            self._inlets[queue] = inlet
            self._subscribe(inlet)

    def close(self, queue: SubscriptionQueue) -> None:
        """Ends a queue's subscription; further calls do nothing."""
        with self._lock:
            inlet = self._inlets.pop(queue, None)
            if inlet is not None and inlet.handle is not None:
                inlet.handle.close()

    def close_all(self) -> None:
        """Ends all subscriptions."""
        with self._lock:
            self._closed = True
            for queue in tuple(self._inlets):
                self.close(queue)

    def adapt(self) -> None:
        """Adapts to the current publishers' profiles."""
        with self._lock:
            if not self._closed:
                for inlet in self._inlets.values():
                    self._subscribe(inlet)

    def move(self, node: NodeName) -> None:
        """Moves all subscriptions to another node."""
        with self._lock:
            self._node = node
            for inlet in self._inlets.values():
                inlet.profile = None
                self._subscribe(inlet)

    def _receiver(self, queue: SubscriptionQueue, msgtype: str) -> Callable[[bytes], None]:
        def receive(data: bytes) -> None:
            try:
                message = decode_cdr(data, msgtype)
            except GraphError as error:
                self._warnings.warn(queue.topic, str(error))
                return
            queue.put(Published(queue.topic, msgtype, time.time_ns(), message))

        return receive

    def _subscribe(self, inlet: _Inlet) -> None:
        """Subscribes so that all current publishers of a topic match, if that is a change."""
        offers = [
            p.profile
            for p in self._participant.publishers()
            if (p.topic, p.msgtype) == (inlet.topic, inlet.msgtype)
        ]
        wanted = Profile(
            reliable=all(offer.reliable for offer in offers),
            latched=bool(offers) and all(offer.latched for offer in offers),
            depth=inlet.depth,
        )
        if inlet.profile == wanted:
            return
        if inlet.handle is not None:
            inlet.handle.close()
        inlet.profile = wanted
        spec = TopicSpec(self._node, inlet.topic, inlet.msgtype, wanted)
        inlet.handle = self._participant.reader(spec, inlet.receive)


class _Inlet:
    """A subscription and its current profile."""

    def __init__(
        self, topic: str, msgtype: str, depth: int, receive: Callable[[bytes], None]
    ) -> None:
        self.topic = topic
        self.msgtype = msgtype
        self.depth = depth
        self.receive = receive
        self.profile: Profile | None = None
        self.handle: Handle | None = None
