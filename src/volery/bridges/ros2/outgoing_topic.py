"""Topics of the graph on their way to ROS 2."""

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
"""One tick may publish once for each UAV, as it does on `/tf`."""
_OWN_KEPT = 1000

_log = logging.getLogger(__name__)


class Ros2OutgoingTopic:
    """One topic: its messages are taken and turned into bytes only while somebody subscribes.

    What is latched is always taken: ROS 2's publishers keep it for those who come later. `serve`
    runs in the worker's thread; all else may be called by any.
    """

    def __init__(
        self, participant: Participant, session: Session, worker: Ros2WriterThread, spec: TopicSpec
    ) -> None:
        self.spec = spec
        self._session = session
        self._worker = worker
        self._mailbox: SubscriptionQueue | None = None
        self._own: OrderedDict[int, Any] = OrderedDict()
        self._complained = False
        self._closed = False
        self._writer = participant.writer(spec)

    @property
    def holds(self) -> bool:
        """Whether it listens to the graph."""
        return self._mailbox is not None

    @property
    def dropped(self) -> int:
        """Messages that were not sent because they came too fast."""
        return 0 if self._mailbox is None else self._mailbox.info.dropped

    @property
    def wanted(self) -> bool:
        """Whether it should listen to the graph."""
        return self.spec.profile.latched or self._writer.matched

    def wake(self) -> None:
        """Have it served."""
        self._worker.post(self.serve)

    def adapt(self) -> None:
        """Begin or end to listen to the graph, as subscribers come and go."""
        if self.wanted != self.holds:
            self._worker.post(self._adapt)

    def _adapt(self) -> None:
        if self._closed or self.wanted == self.holds:
            return
        if self.holds:
            self._let_go()
        else:
            self._mailbox = self._session.subscribe(
                self.spec.topic, self.spec.msgtype, depth=_DEPTH, wake=self.wake
            )

    def leave_out(self, message: Any) -> None:
        """Do not send a message that came from ROS 2 itself."""
        if self._mailbox is not None:
            self._own[id(message)] = message
            if len(self._own) > _OWN_KEPT:
                self._own.popitem(last=False)

    def serve(self) -> None:
        """Send what waits."""
        if self._mailbox is None:  # it listens no more, or is closed
            return
        for published in self._mailbox.take():
            if not self._own or self._own.pop(id(published.message), None) is None:
                self._send(published)

    def close(self) -> None:
        """Publish no more; in the worker's thread or after its end."""
        self._closed = True
        self._let_go()
        self._writer.close()

    def _send(self, published: Any) -> None:
        try:
            cdr = published.cdr
        except (*CODING_ERRORS, AssertionError) as error:
            if not self._complained:
                self._complained = True
                _log.warning("ROS 2 topic %s: %s", self.spec.topic, error)
            return
        self._writer.write(cdr)

    def _let_go(self) -> None:
        if self._mailbox is not None:
            self._session.unsubscribe(self._mailbox)
            self._mailbox = None
            self._own.clear()
