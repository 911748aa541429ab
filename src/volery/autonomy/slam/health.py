"""Whether the motion is followed: in words, and as a state."""

from __future__ import annotations

from typing import Any

from volery.autonomy.slam.match import MANY, MISFIT
from volery.autonomy.slam.tracker import Tracker
from volery.core.clock import NS_PER_S
from volery.core.saved_state import restore_attributes, save_attributes

_SILENT_NS = NS_PER_S
_LOST_NS = NS_PER_S
_FEW = 6.0
"""Uprights met again by both LIDARs below which a place is too empty to hold on to."""
_UNSURE_M = 1.0
"""Standard deviation of the place since which nobody knows where it is."""


class SlamHealth:
    """Watches a tracker; `state` is starting, tracking, degraded or lost."""

    _STATE = ("state", "problems", "heard", "_misfit_ns", "_scarce_ns")

    def __init__(self, names: tuple[str, ...], now_ns: int) -> None:
        self.state = "starting"
        self.problems: list[str] = []
        self.heard: dict[str, int] = dict.fromkeys(names, now_ns)
        """When sensors were last heard of, by name."""
        self._misfit_ns: int | None = None
        self._scarce_ns: int | None = None

    def look(self, tracker: Tracker, now_ns: int, is_placed: bool) -> bool:
        """Judge anew; whether the motion has been lost just now."""
        self.problems = [
            f"the {name} is silent"
            for name, heard in self.heard.items()
            if now_ns - heard > _SILENT_NS
        ]
        if not tracker.is_ready:
            self.state = "starting"
            self.problems.append("waiting for half a second of standing still")
            return False
        misfit = self._is_lost(tracker)
        if misfit:
            self.problems.append("what is seen is not what was there")
        if tracker.is_astray:
            self.problems.append("the IMU has left out how it moved")
        if not is_placed:
            self.problems.append("where in the map is not known")
        if self._scarce_ns is not None and now_ns - self._scarce_ns > _LOST_NS:
            self.problems.append("too few things in reach")
        if misfit or tracker.is_astray or not is_placed:
            self.state = "lost"
        else:
            self.state = "degraded" if self.problems else "tracking"
        return misfit

    def _is_lost(self, tracker: Tracker) -> bool:
        now = tracker.time_ns
        if tracker.is_astray:
            return tracker.recovery.has_failed(tracker.covariance, now)
        fresh = [m for m in tracker.match.values() if now - m.time_ns < NS_PER_S // 2]
        met = sum(m.met for m in fresh)
        few = met < _FEW and not tracker.is_standing
        self._scarce_ns = (self._scarce_ns or now) if few else None
        seen, usual = sum(m.seen for m in fresh), sum(m.usual * m.seen for m in fresh)
        unfit = seen >= MANY and met < MISFIT * usual
        self._misfit_ns = (self._misfit_ns or now) if unfit and tracker.has_flown else None
        long = self._misfit_ns is not None and now - self._misfit_ns > _LOST_NS
        return long or tracker.sight.is_broken or tracker.sigma_m > _UNSURE_M

    def begin_anew(self) -> None:
        """The tracker has begun a new map."""
        self._misfit_ns = self._scarce_ns = None

    def get_state(self) -> dict[str, Any]:
        """What a snapshot keeps."""
        return save_attributes(self, self._STATE)

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state."""
        restore_attributes(self, state)
