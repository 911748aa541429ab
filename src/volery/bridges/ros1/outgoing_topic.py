"""Sends topics of the graph to ROS 1 subscribers."""

from __future__ import annotations

import logging
from collections import OrderedDict
from collections.abc import Iterable
from typing import Any

from volery.bridges.ros1.node import Ros1Node
from volery.bridges.ros1.writer_thread import Reader, Ros1WriterThread
from volery.core.errors import GraphError
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.messages import Published
from volery.graph.session import Session
from volery.graph.subscription_queue import SubscriptionQueue

_DEPTH = 1000
"""Queue depth: one tick may publish once for each UAV, as on `/tf`."""
_OWN_KEPT = 1000

_log = logging.getLogger(__name__)


class Ros1OutgoingTopic:
    """One topic; its messages are received and encoded only while it has subscribers.

    `serve` runs in the writer's thread; any thread may call the other methods.
    """

    def __init__(
        self,
        node: Ros1Node,
        session: Session,
        pump: Ros1WriterThread,
        info: tuple[str, str],
        *,
        latched: bool,
    ) -> None:
        self.topic, self.msgtype = info
        self.latched = latched
        self.wake = pump.waker(self)
        self._session = session
        self._pump = pump
        self._encode = ros1_codec().encode
        self._queue: SubscriptionQueue | None = None
        self._connections: list[Any] = []
        self._readers: dict[Any, Reader] = {}
        self._own: OrderedDict[int, Any] = OrderedDict()
        self._sequence = 0
        self._dropped = 0
        self._has_warned = False
        self._publisher = node.outlet(self.topic, self.msgtype, self.wake, latched=latched)
        self.wake()

    @property
    def is_current(self) -> bool:
        """Whether the subscription to the graph matches the presence of ROS 1 subscribers."""
        return bool(self._publisher.get_num_connections()) == self.holds

    @property
    def holds(self) -> bool:
        """Whether it subscribes to the graph."""
        return self._queue is not None

    @property
    def dropped(self) -> int:
        """Number of messages that slow subscribers missed."""
        return self._dropped + sum(reader.dropped for reader in tuple(self._readers.values()))

    def leave_out(self, message: Any) -> None:
        """Skips a message that came from ROS 1 itself."""
        if self._queue is not None:
            self._own[id(message)] = message
            if len(self._own) > _OWN_KEPT:
                self._own.popitem(last=False)

    def serve(self) -> None:
        """Sends queued messages.

        Subscribes to or unsubscribes from the graph with the subscribers.
        """
        newcomers = self._meet()
        if not self._readers:
            self._let_go()
            return
        if self._queue is None:  # a new queue has the latched messages, for all readers
            self._queue = self._session.subscribe(
                self.topic, self.msgtype, depth=_DEPTH, wake=self.wake
            )
            newcomers = []
        kept = self._latched_messages() if self.latched and newcomers else []
        fresh = self._queue.take()
        known = {id(published) for published in fresh}
        for published in kept:
            if id(published) not in known:
                self._send(published, newcomers)
        for published in fresh:
            if not self._own or self._own.pop(id(published.message), None) is None:
                self._send(published, self._readers.values())

    def close(self) -> None:
        """Ends the publication, after the writer thread has ended."""
        self._let_go()
        self._publisher.unregister()
        for reader in self._readers.values():
            reader.close()

    def _meet(self) -> list[Reader]:
        """Matches the readers with rospy's connections; returns the new ones."""
        connections = self._publisher.impl.connections  # rospy replaces the list at each change
        if connections is self._connections:
            return []
        self._connections = connections
        for gone in [known for known in self._readers if known not in connections]:
            reader = self._readers.pop(gone)
            reader.close()
            self._dropped += reader.dropped
        newcomers = []
        for connection in connections:
            if connection not in self._readers:
                try:
                    reader = self._pump.reader(connection)
                except (OSError, TypeError):  # closed already
                    continue
                self._readers[connection] = reader
                newcomers.append(reader)
        return newcomers

    def _latched_messages(self) -> list[Published]:
        """Returns the last messages of latched publishers of the graph."""
        glance = self._session.subscribe(self.topic, self.msgtype, depth=_DEPTH, wake=_nothing)
        self._session.unsubscribe(glance)
        return glance.take()

    def _send(self, published: Published, readers: Iterable[Reader]) -> None:
        try:
            data = self._encode(published.message, self.msgtype, self._sequence)
        except GraphError as error:
            if not self._has_warned:
                self._has_warned = True
                _log.warning("ROS 1 topic %s: %s", self.topic, error)
            return
        self._sequence += 1
        for reader in tuple(readers):
            reader.send(data)

    def _let_go(self) -> None:
        if self._queue is not None:
            self._session.unsubscribe(self._queue)
            self._queue = None
            self._own.clear()


def _nothing() -> None:
    """Does nothing, because no reader needs a wake-up."""
