"""Provides the queue of one topic's messages for one client of another thread."""

from __future__ import annotations

import itertools
import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, is_dataclass
from typing import Any

import numpy as np

from volery.core.plurals import counted
from volery.graph.lazy_list import LazyList
from volery.graph.messages import Published
from volery.graph.qos import MAX_DEPTH

Wake = Callable[[], None]
"""Called in the simulation's thread when messages are available; must not block."""

MAX_RELIABLE_BYTES = 256 * 1024 * 1024
"""Limit of the bytes queued for a reliable subscriber; beyond, its subscription ends."""

_PART_BYTES = 100
_NUMBER_BYTES = 8

_arrivals = itertools.count()


@dataclass(frozen=True)
class SubscriptionQueueInfo:
    """Counts of a subscription of an external client."""

    topic: str
    received: int
    dropped: int
    waiting: int


class SubscriptionQueue:
    """Queues messages of one topic for one client.

    With best effort, the newest `depth` messages. A `reliable` queue drops none, up to MAX_DEPTH
    messages or MAX_RELIABLE_BYTES: a client that is farther behind will never catch up, so the
    queue then empties, accepts no more and gives the reason in `failure`.
    """

    def __init__(self, topic: str, depth: int, wake: Wake, *, reliable: bool = False) -> None:
        self.topic = topic
        self._failure: str | None = None
        self._waiting: deque[tuple[int, Published]] = deque()
        self._depth = depth
        self._reliable = reliable
        self._bytes = 0
        self._wake = wake
        self._lock = threading.Lock()
        self._received = 0
        self._dropped = 0

    @property
    def failure(self) -> str | None:
        """Reason why the subscription has ended; None while it is active."""
        return self._failure

    def put(self, published: Published) -> None:
        """Adds a message; a full queue drops its oldest one, or ends if it is reliable."""
        with self._lock:
            if self._failure is not None:
                return
            self._received += 1
            was_empty = not self._waiting
            if self._reliable:
                self._bytes += array_bytes(published.message)
                if len(self._waiting) >= MAX_DEPTH or self._bytes > MAX_RELIABLE_BYTES:
                    self._give_up()
            elif len(self._waiting) >= self._depth:
                self._waiting.popleft()
                self._dropped += 1
            if self._failure is None:
                self._waiting.append((next(_arrivals), published))
        if was_empty or self._failure is not None:
            self._wake()

    def end(self, reason: str) -> None:
        """Ends the subscription; messages in the queue are dropped."""
        with self._lock:
            if self._failure is None:
                self._failure = f"subscription of '{self.topic}' ended: {reason}"
                self._dropped += len(self._waiting)
                self._waiting.clear()
                self._bytes = 0
        self._wake()

    def _give_up(self) -> None:
        size = self._bytes / 2**20
        self._failure = (
            f"reliable subscription of '{self.topic}' ended: "
            f"{counted(len(self._waiting), 'message')} ({size:.0f} MB) waited for a client "
            "that is too slow; receive fewer topics or use best effort"
        )
        self._dropped += len(self._waiting) + 1
        self._waiting.clear()
        self._bytes = 0

    def take(self, max_count: int | None = None) -> list[Published]:
        """Removes and returns the queued messages, oldest first, at most `max_count`."""
        return [published for _, published in self.take_numbered(max_count)]

    def take_numbered(self, max_count: int | None = None) -> list[tuple[int, Published]]:
        """Like `take`, with numbers that give the order of arrival across all queues."""
        with self._lock:
            count = len(self._waiting) if max_count is None else min(max_count, len(self._waiting))
            taken = [self._waiting.popleft() for _ in range(count)]
            if self._reliable:
                self._bytes -= sum(array_bytes(published.message) for _, published in taken)
            return taken

    @property
    def next_number(self) -> int | None:
        """Number, as in `take_numbered`, of the next message; None if the queue is empty."""
        with self._lock:
            return self._waiting[0][0] if self._waiting else None

    @property
    def info(self) -> SubscriptionQueueInfo:
        """The counts so far."""
        with self._lock:
            return SubscriptionQueueInfo(
                self.topic, self._received, self._dropped, len(self._waiting)
            )


def array_bytes(message: Any) -> int:
    """Returns the bytes of the arrays and texts in the first two levels of a message.

    Deeper levels are small compared to the limit.
    """
    size = 0
    for name, value in vars(message).items():
        if isinstance(value, np.ndarray):
            size += value.nbytes
        elif isinstance(value, str | bytes | list | LazyList) and not name.startswith("__"):
            size += len(value)
        elif is_dataclass(value):
            inner = vars(value).values()
            size += sum(array.nbytes for array in inner if isinstance(array, np.ndarray))
    return size


def message_bytes(message: Any) -> int:
    """Returns the bytes of all arrays and texts of a message, plus some for each part.

    Visits every part, so this is for messages that are published rarely.
    """
    if isinstance(message, np.ndarray):
        return int(message.nbytes)
    if isinstance(message, str | bytes):
        return len(message)
    if isinstance(message, list | LazyList):
        return sum(map(message_bytes, message))
    if is_dataclass(message):
        return _PART_BYTES + sum(map(message_bytes, vars(message).values()))
    return _NUMBER_BYTES
