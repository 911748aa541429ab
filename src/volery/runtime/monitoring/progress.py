"""Reports the progress of a run, about ten times a second of wall time."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from volery.engine.pacing import Pacer

_PERIOD_S = 0.1


@dataclass(frozen=True)
class Progress:
    """Describes the progress of a run."""

    time_s: float
    """Simulated time since the run began, or since the last reset, s."""
    duration_s: float
    """Simulated time at which the run ends, s."""
    wall_s: float
    """Wall time since the run began, without pauses, s."""
    paused: bool = False
    """Whether the run is paused."""
    before_s: float = 0.0
    """Simulated time before the last reset, summed over all resets, s."""

    @property
    def real_time_factor(self) -> float:
        """Simulated time over wall time of this run."""
        return (self.before_s + self.time_s) / self.wall_s if self.wall_s > 0.0 else 0.0


class ProgressPublisher:
    """Calls `on_progress`, if given, each 0.1 s of wall time."""

    def __init__(
        self, on_progress: Callable[[Progress], None] | None, duration_s: float, pacer: Pacer
    ) -> None:
        self._on_progress = on_progress
        self._duration_s = duration_s
        self._pacer = pacer
        self._begun = self._last_report = time.perf_counter()
        self._paused_before_s = pacer.paused_s
        self._last_s = self._before_s = 0.0

    def report(self, time_s: float, *, last: bool = False) -> None:
        """Reports that the run has reached `time_s`; the `last` time in any case."""
        if time_s < self._last_s:  # a reset or restore
            self._before_s += self._last_s
        self._last_s = time_s
        now = time.perf_counter()
        if self._on_progress is None or (now - self._last_report < _PERIOD_S and not last):
            return
        self._last_report = now
        wall_s = now - self._begun - (self._pacer.paused_s - self._paused_before_s)
        self._on_progress(
            Progress(time_s, self._duration_s, wall_s, self._pacer.paused, self._before_s)
        )
