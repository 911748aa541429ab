"""Frames for one client of the sensor link: the newest few of each sensor.

A client that does not read loses its own frames, costs a bounded amount of memory and does not
delay others. Sensors take turns, so that one with a high rate does not starve the others.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable


class SensorLinkOutbox:
    """Bounded queues of frames, one per sensor. depth: frames that may wait in each."""

    def __init__(self, depth: int) -> None:
        self._depth = depth
        self._waiting: dict[Hashable, deque[bytes]] = {}
        self._turns: deque[Hashable] = deque()
        self.dropped = 0
        """Number of frames dropped for newer ones."""

    def put(self, sensor: Hashable, frame: bytes) -> None:
        """Adds a frame; without room the sensor's oldest one is dropped."""
        queue = self._waiting.get(sensor)
        if queue is None:
            queue = self._waiting[sensor] = deque(maxlen=self._depth)
        if not queue:
            self._turns.append(sensor)
        self.dropped += len(queue) == self._depth
        queue.append(frame)

    def take(self) -> bytes | None:
        """Removes and returns the next frame; None if nothing waits."""
        if not self._turns:
            return None
        sensor = self._turns.popleft()
        queue = self._waiting[sensor]
        frame = queue.popleft()
        if queue:
            self._turns.append(sensor)
        return frame

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values()))
