"""Simulated time against wall time: real time, any factor, or as fast as possible."""

from __future__ import annotations

import time

from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError

_SLICE_S = 0.005
_LONGEST_SLEEP_S = 0.05


class Pacer:
    """Holds a run at `speed` times real time; None lets it run as fast as it can.

    A run that falls behind does not rush afterwards to catch up more than `_SLACK_S`.
    """

    _SLACK_S = 0.25

    def __init__(self, speed: float | None, start_ns: int) -> None:
        if speed is not None and not 0.0 < speed < 1e6:
            raise CommandError(f"speed must be a positive factor of real time, not {speed}")
        self._speed = speed
        self._wall_start = time.perf_counter()
        self._sim_start_ns = start_ns

    def slice_ns(self) -> int | None:
        """Longest piece to simulate at once, None for no limit."""
        if self._speed is None:
            return None
        return max(1, round(_SLICE_S * self._speed * NS_PER_S))

    def wait(self, time_ns: int) -> bool:
        """Sleep towards the wall time of `time_ns`, at most a moment; whether more is to be waited.

        The moments let a caller tell its progress, and a user stop, in very slow runs.
        """
        if self._speed is None:
            return False
        due = self._wall_start + (time_ns - self._sim_start_ns) / NS_PER_S / self._speed
        ahead = due - time.perf_counter()
        if ahead > 0.0:
            time.sleep(min(ahead, _LONGEST_SLEEP_S))
        elif ahead < -self._SLACK_S:
            self._wall_start -= ahead + self._SLACK_S
        return ahead > _LONGEST_SLEEP_S
