"""Measures how far disturbances push a vehicle off its plans, and what margin that needs."""

from __future__ import annotations

import math

from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes

_MEMORY_S = 30.0
"""Time constant with which a deviation is forgotten: gusts come again."""
_EXPECTED_M = 0.3
"""Deviation that the radius of the planner includes: the largest in calm air."""
_STRONGER = 1.5
"""Factor by which the next gust may push farther than the last ones."""


class TrackingError(SavedAttributes):
    """Largest horizontal distance of the last half minute between a vehicle and its plan."""

    STATE = ("largest_m", "_time_ns")

    def __init__(self) -> None:
        self.largest_m = 0.0
        """Largest distance, m, which decays with time."""
        self._time_ns = 0

    def add(self, distance_m: float, now_ns: int) -> None:
        """Adds a distance at a time."""
        elapsed_s = max(0.0, (now_ns - self._time_ns) / NS_PER_S)
        self.largest_m = max(distance_m, self.largest_m * math.exp(-elapsed_s / _MEMORY_S))
        self._time_ns = now_ns

    @property
    def margin_m(self) -> float:
        """Distance to keep from obstacles in addition to the planner's radius, m."""
        return _STRONGER * max(0.0, self.largest_m - _EXPECTED_M)
