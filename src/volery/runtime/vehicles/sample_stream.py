"""Queues the samples of one sensor for a loop that reads them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any

from volery.sensors.sensor_samples import SensorSample

Advance = Callable[[Callable[[], bool]], bool]
"""Advances the simulation until a condition is true; returns whether it became true."""


class SampleStream(Iterator[Any]):
    """Returns the samples of one sensor since the stream was opened, each once, oldest first.

    A loop over the stream advances the simulation from sample to sample:

        for scan in uav.sensors["horizontal"].samples(seconds=10.0):
            uav.command_velocity(steer(scan.ranges))

    Commands of the loop's body act from the next physics step. If the body advances the simulation
    itself, the samples of that time queue up and come next. `take` returns the queued samples
    without a step, for loops around `Simulation.run`. A reset, or another state restored, empties
    the queue.
    """

    def __init__(
        self,
        path: str,
        on_close: Callable[[SampleStream], None],
        *,
        advance: Advance,
        depth: int | None = None,
    ) -> None:
        self.path = path
        """UAV and sensor, such as `uav1/imu`."""
        self._on_close = on_close
        self._advance = advance
        self._queue: deque[SensorSample] = deque(maxlen=depth)
        self._is_closed = False

    def take(self) -> list[Any]:
        """Returns the samples since the last call, oldest first, without a step."""
        samples = list(self._queue)
        self._queue.clear()
        return samples

    def __next__(self) -> Any:
        """Returns the next sample; advances the simulation if none is queued."""
        if not self._queue and (self._is_closed or not self._advance(self._has_samples)):
            self.close()
            raise StopIteration
        return self._queue.popleft()

    def close(self) -> None:
        """Ends the stream: it receives no more samples, and its loop ends with the queued ones."""
        self._is_closed = True
        self._on_close(self)

    def add(self, sample: SensorSample) -> None:
        """Adds a sample; the oldest one leaves a full queue."""
        self._queue.append(sample)

    def clear(self) -> None:
        """Removes the queued samples."""
        self._queue.clear()

    def _has_samples(self) -> bool:
        return bool(self._queue)
