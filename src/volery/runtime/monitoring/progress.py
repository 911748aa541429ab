"""How far a run has come, told about ten times a second of wall time."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

from volery.engine.pacing import Pacer

_PERIOD_S = 0.1


@dataclass(frozen=True)
class Progress:
    """How far a run has come."""

    time_s: float
    """Simulated time since the run began, or since the last reset."""
    duration_s: float
    wall_s: float
    """Wall time since the run began, pauses left out."""
    paused: bool = False
    before_s: float = 0.0
    """Simulated time that had gone by before the last reset, from all resets together."""

    @property
    def real_time_factor(self) -> float:
        """Simulated over wall time of this run."""
        return (self.before_s + self.time_s) / self.wall_s if self.wall_s > 0.0 else 0.0


class ProgressPublisher:
    """Calls `on_progress`, if there is one, where enough wall time has gone by."""

    def __init__(
        self, on_progress: Callable[[Progress], None] | None, duration_s: float, pacer: Pacer
    ) -> None:
        self._on_progress = on_progress
        self._duration_s = duration_s
        self._pacer = pacer
        self._begun = self._told = time.perf_counter()
        self._paused_before_s = pacer.paused_s
        self._last_s = self._before_s = 0.0

    def tell(self, time_s: float, *, last: bool = False) -> None:
        """Tell that the run has come to `time_s`; the `last` time in any case."""
        if time_s < self._last_s:  # the clock was set back
            self._before_s += self._last_s
        self._last_s = time_s
        now = time.perf_counter()
        if self._on_progress is None or (now - self._told < _PERIOD_S and not last):
            return
        self._told = now
        wall_s = now - self._begun - (self._pacer.paused_s - self._paused_before_s)
        self._on_progress(
            Progress(time_s, self._duration_s, wall_s, self._pacer.paused, self._before_s)
        )
