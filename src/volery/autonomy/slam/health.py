"""Health of the tracking: a state, and problems as text."""

from __future__ import annotations

from volery.autonomy.slam.match import MANY, MISFIT
from volery.autonomy.slam.tracker import Tracker
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes

_SILENT_NS = NS_PER_S
_LOST_NS = NS_PER_S
_FEW = 6.0
"""Uprights matched by both LIDARs below which the surroundings are too empty."""
_UNSURE_M = 1.0
"""Standard deviation of the position above which tracking is lost, m."""


class SlamHealth(SavedAttributes):
    """Monitors a tracker; `state` is starting, tracking, degraded or lost."""

    STATE = ("state", "problems", "received_ns", "_misfit_ns", "_scarce_ns")

    def __init__(self, names: tuple[str, ...], now_ns: int) -> None:
        self.state = "starting"
        self.problems: list[str] = []
        self.received_ns: dict[str, int] = dict.fromkeys(names, now_ns)
        """Times of the last data of each sensor, by name, ns."""
        self._misfit_ns: int | None = None
        self._scarce_ns: int | None = None

    def look(self, tracker: Tracker, now_ns: int, is_placed: bool) -> bool:
        """Updates state and problems; returns whether tracking has just been lost."""
        self.problems = [
            f"the {name} is silent"
            for name, last_ns in self.received_ns.items()
            if now_ns - last_ns > _SILENT_NS
        ]
        if not tracker.is_ready:
            self.state = "starting"
            self.problems.append("waiting for the vehicle to stand still for 0.5 s")
            return False
        misfit = self._is_lost(tracker)
        if misfit:
            self.problems.append("scans do not match the map")
        if tracker.is_astray:
            self.problems.append("gap in the IMU data")
        if not is_placed:
            self.problems.append("pose in the map unknown")
        if self._scarce_ns is not None and now_ns - self._scarce_ns > _LOST_NS:
            self.problems.append("too few returns in range")
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
        few = met < _FEW and not tracker.is_stationary
        self._scarce_ns = (self._scarce_ns or now) if few else None
        seen, usual = sum(m.seen for m in fresh), sum(m.usual * m.seen for m in fresh)
        unfit = seen >= MANY and met < MISFIT * usual
        self._misfit_ns = (self._misfit_ns or now) if unfit and tracker.has_flown else None
        long = self._misfit_ns is not None and now - self._misfit_ns > _LOST_NS
        return long or tracker.sight.is_broken or tracker.sigma_m > _UNSURE_M

    def restart(self) -> None:
        """Resets the misfit times after the tracker has begun a new map."""
        self._misfit_ns = self._scarce_ns = None
