"""Bounded queue for one topic's messages from a peer to the graph."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any

from volery.graph.session import Session


class IncomingQueue:
    """Publishes for a peer; while the simulation is busy the newest `depth` messages wait."""

    def __init__(self, session: Session, topic: str, msgtype: str, depth: int) -> None:
        self.topic = topic
        self.msgtype = msgtype
        self._session = session
        self._waiting: deque[Any] = deque(maxlen=depth)
        self._depth = depth
        self._num_pending = 0
        self._lock = threading.Lock()
        self.dropped = 0

    def put(self, message: Any) -> None:
        """Publishes a message, or queues it in the place of the oldest one."""
        with self._lock:
            if self._num_pending >= self._depth:
                self.dropped += len(self._waiting) == self._depth
                self._waiting.append(message)
                return
            self._num_pending += 1
        self._publish(message)

    def _publish(self, message: Any) -> None:
        self._session.publish(self.topic, message)
        self._session.post(self._arrived)  # posts run in order: the message is published by then

    def _arrived(self) -> None:
        with self._lock:
            if not self._waiting:
                self._num_pending -= 1
                return
            message = self._waiting.popleft()
        if self._session.published_type(self.topic) is not None:
            self._publish(message)
