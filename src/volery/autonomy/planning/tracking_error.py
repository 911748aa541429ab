"""Measures how far disturbances push a vehicle off its plans, and what margin that needs."""

from __future__ import annotations

import math

from volery.core.clock import NS_PER_S, ns_from_s
from volery.core.saved_state import SavedAttributes

_MEMORY_S = 30.0
"""Time constant with which a deviation is forgotten: gusts come again."""
_NOTICED_S = 1.0
"""Time within which faults of the odometry are noticed."""
_EXPECTED_M = 0.3
"""Deviation that the radius of the planner includes: the largest in calm air."""
_TOO_LARGE_M, _CALM_M = 1.2, 0.8
"""Distances at which a vehicle can no longer fly among obstacles, and can again."""
_STRONGER = 1.5
"""Factor by which the next gust may push farther than the last ones."""


class TrackingError(SavedAttributes):
    """Largest horizontal distance of the last half minute between a vehicle and its plan."""

    STATE = ("is_too_large", "_recent", "_earlier_m", "_time_ns")

    def __init__(self) -> None:
        self._recent: tuple[tuple[int, float], ...] = ()
        """Times, ns, and distances, m, of the last second."""
        self.is_too_large = False
        """Whether no margin is enough; until the largest distance is much smaller again."""
        self._earlier_m = 0.0
        """Largest distance before `_recent`, which decays with time."""
        self._time_ns = 0

    @property
    def largest_m(self) -> float:
        """Largest distance, m; it decays with time."""
        return max(self._earlier_m, *(distance for _, distance in self._recent), 0.0)

    def add(self, distance_m: float, now_ns: int) -> None:
        """Adds a distance at a time."""
        self._earlier_m = _faded(self._earlier_m, now_ns - self._time_ns)
        self._time_ns = now_ns
        since_ns = now_ns - ns_from_s(_NOTICED_S)
        for time_ns, distance in self._recent:
            if time_ns <= since_ns:
                self._earlier_m = max(self._earlier_m, _faded(distance, now_ns - time_ns))
        recent = tuple(entry for entry in self._recent if entry[0] > since_ns)
        self._recent = (*recent, (now_ns, distance_m))
        self.is_too_large = self.largest_m > (_CALM_M if self.is_too_large else _TOO_LARGE_M)

    def retract(self) -> None:
        """Drops the distances of the last second: the odometry was wrong."""
        self._recent = ()
        self.is_too_large &= self._earlier_m > _CALM_M

    @property
    def margin_m(self) -> float:
        """Distance to keep from obstacles in addition to the planner's radius, m."""
        return _STRONGER * max(0.0, self.largest_m - _EXPECTED_M)


def _faded(distance_m: float, age_ns: int) -> float:
    return distance_m * math.exp(-max(age_ns, 0) / NS_PER_S / _MEMORY_S)
