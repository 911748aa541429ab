"""One UAV's coverage flight: its next waypoint and its progress."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from volery.autonomy.coverage.waypoints import WaypointProgress
from volery.core.arrays import Array
from volery.core.vectors import norm

_PROGRESS_M = 0.2
"""Decrease of the distance that counts as progress. Modelling choice."""
_CLIMBED_M, _STILL_M_S = 0.5, 0.2
"""Min rise and max climb rate at the end of a take-off. Modelling choice."""
_STOPPED_M_S, _STOP_NS = 0.3, 3_000_000_000
"""Max speed over ground of a UAV that has stopped, and how long it is given. Modelling choice."""


class CoveragePhase(StrEnum):
    """Phase of a UAV's flight."""

    GROUND = "ground"
    """Take-off not requested yet."""
    TAKE_OFF = "take_off"
    COVER = "cover"
    DONE = "done"
    """Has covered its area, or has none, and lands."""
    FAILED = "failed"
    """Timed out or makes no progress; takes no further part."""


@dataclass
class CoverageFlight:
    """State of one UAV. Times are ns of the node's clock."""

    name: str
    phase: CoveragePhase = CoveragePhase.GROUND
    position_map: Array | None = None
    climb_m_s: float = 0.0
    speed_m_s: float = 0.0
    received_ns: int = 0
    home_map: Array | None = None
    waypoints: WaypointProgress | None = None
    following: int = 0
    """Number of the next waypoint."""
    published: int = -1
    """Number of the last waypoint sent to it."""
    nearest_m: float = math.inf
    """Min distance to it so far, and since when it has not decreased."""
    since_ns: int = 0

    def moved(
        self, position_map: Array, climb_m_s: float, now_ns: int, speed_m_s: float = 0.0
    ) -> None:
        """Stores the current position, climb rate and speed over ground."""
        self.position_map, self.climb_m_s, self.received_ns = position_map, climb_m_s, now_ns
        self.speed_m_s = speed_m_s
        if self.home_map is None:
            self.home_map = position_map.copy()

    def send(self, waypoints: WaypointProgress, now_ns: int) -> None:
        """Sets other waypoints."""
        self.waypoints, self.following, self.published = waypoints, 0, -1
        self._begin_leg(now_ns)

    @property
    def has_climbed(self) -> bool:
        """Whether a take-off has ended."""
        assert self.position_map is not None
        assert self.home_map is not None
        risen = float(self.position_map[2] - self.home_map[2])
        return risen > _CLIMBED_M and self.is_level

    @property
    def is_level(self) -> bool:
        """Whether it neither climbs nor descends noticeably."""
        return abs(self.climb_m_s) < _STILL_M_S

    def has_stopped(self, now_ns: int) -> bool:
        """Returns whether it has stopped at its last goal, or cannot in gusts."""
        return self.speed_m_s < _STOPPED_M_S or now_ns - self.since_ns > _STOP_NS

    @property
    def covers(self) -> bool:
        """Whether the cells below count as covered."""
        return (
            self.phase is CoveragePhase.COVER
            and self.waypoints is not None
            and bool(
                self.waypoints.covering[min(self.following, len(self.waypoints.positions) - 1)]
            )
        )

    def goal(self, acceptance_radius_m: float, now_ns: int) -> Array | None:
        """Returns the current waypoint (3,) m, advancing past reached ones; None at the end."""
        assert self.position_map is not None
        assert self.waypoints is not None
        while self.following < len(self.waypoints.positions):
            goal: Array = self.waypoints.positions[self.following]
            away = norm(goal - self.position_map)
            if away > acceptance_radius_m:
                if away < self.nearest_m - _PROGRESS_M:
                    self.nearest_m, self.since_ns = away, now_ns
                return goal
            self.following += 1
            self._begin_leg(now_ns)
        return None

    def is_lost(self, timeout_s: float, now_ns: int) -> bool:
        """Returns whether odometry or progress have been missing for `timeout_s`."""
        return now_ns - min(self.received_ns, self.since_ns) > timeout_s * 1e9

    def _begin_leg(self, now_ns: int) -> None:
        self.nearest_m, self.since_ns = math.inf, now_ns
