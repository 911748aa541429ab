"""Sends topics of the graph to ROS 2."""

from __future__ import annotations

import logging
from collections import OrderedDict
from typing import Any

from volery.bridges.ros2.middleware import Participant, TopicSpec
from volery.bridges.ros2.writer_thread import Ros2WriterThread
from volery.graph.codecs.cdr import CODING_ERRORS
from volery.graph.session import Session
from volery.graph.subscription_queue import SubscriptionQueue

_DEPTH = 1000
"""Queue depth: one tick may publish once for each UAV, as on `/tf`."""
_OWN_KEPT = 1000

_log = logging.getLogger(__name__)


class Ros2OutgoingTopic:
    """One topic; its messages are received and encoded only while it has subscribers.

    Latched topics are always received: ROS 2's publishers store them for late subscribers. `serve`
    runs in the writer's thread; any thread may call the other methods.
    """

    def __init__(
        self, participant: Participant, session: Session, worker: Ros2WriterThread, spec: TopicSpec
    ) -> None:
        self.spec = spec
        self._session = session
        self._worker = worker
        self._queue: SubscriptionQueue | None = None
        self._own: OrderedDict[int, Any] = OrderedDict()
        self._has_warned = False
        self._closed = False
        self._writer = participant.writer(spec)

    @property
    def is_subscribed(self) -> bool:
        """Whether it subscribes to the graph."""
        return self._queue is not None

    @property
    def dropped(self) -> int:
        """Number of messages that were not sent in time."""
        return 0 if self._queue is None else self._queue.info.dropped

    @property
    def should_subscribe(self) -> bool:
        """Whether it should subscribe to the graph."""
        return self.spec.profile.latched or self._writer.matched

    def wake(self) -> None:
        """Schedules `serve`."""
        self._worker.post(self.serve)

    def adapt(self) -> None:
        """Subscribes to or unsubscribes from the graph with the subscribers."""
        if self.should_subscribe != self.is_subscribed:
            self._worker.post(self._adapt)

    def _adapt(self) -> None:
        if self._closed or self.should_subscribe == self.is_subscribed:
            return
        if self.is_subscribed:
            self._let_go()
        else:
            self._queue = self._session.subscribe(
                self.spec.topic, self.spec.msgtype, depth=_DEPTH, wake=self.wake
            )

    def leave_out(self, message: Any) -> None:
        """Skips a message that came from ROS 2 itself."""
        if self._queue is not None:
            self._own[id(message)] = message
            if len(self._own) > _OWN_KEPT:
                self._own.popitem(last=False)

    def serve(self) -> None:
        """Sends queued messages."""
        if self._queue is None:  # unsubscribed, or closed
            return
        for published in self._queue.take():
            if not self._own or self._own.pop(id(published.message), None) is None:
                self._send(published)

    def close(self) -> None:
        """Ends the publication; in the writer's thread or after its end."""
        self._closed = True
        self._let_go()
        self._writer.close()

    def _send(self, published: Any) -> None:
        try:
            cdr = published.cdr
        except (*CODING_ERRORS, AssertionError) as error:
            if not self._has_warned:
                self._has_warned = True
                _log.warning("ROS 2 topic %s: %s", self.spec.topic, error)
            return
        self._writer.write(cdr)

    def _let_go(self) -> None:
        if self._queue is not None:
            self._session.unsubscribe(self._queue)
            self._queue = None
            self._own.clear()
