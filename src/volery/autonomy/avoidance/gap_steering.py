"""Steers towards a goal through the gaps between obstacles, at a speed that allows to stop.

Nodes with different sensors share it: they store obstacles, this computes velocity and yaw rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from volery.autonomy.avoidance.gaps import choose_heading, free_distances, wrap
from volery.autonomy.avoidance.obstacle_memory import ObstacleMemory
from volery.autonomy.perception.scan_points import OdometrySample
from volery.core.arrays import Array

MAX_RANGE_M = 14.0
"""Range of the obstacles that matter."""
_STUCK_AFTER_S = 8.0
_STUCK_PROGRESS_M = 2.0
_DETOUR_S = 5.0


@dataclass(frozen=True)
class SpeedLimits:
    """Safety distance and braking."""

    safe_radius_m: float = 1.1
    """Min distance between its centre and obstacles."""
    deceleration_m_s2: float = 2.0
    """Braking that limits the speed."""
    aside_rad: float = math.radians(50.0)
    """Angle between heading and path beyond which the UAV flies slowly."""
    aside_m_s: float = 0.5
    """Max speed beyond `aside_rad`."""


class GapSteering:
    """Computes velocity and yaw rate towards a goal; tries detours without progress."""

    def __init__(self, caution: SpeedLimits) -> None:
        self._caution = caution
        self._last_heading: float | None = None
        self._progress: tuple[int, float] = (0, math.inf)
        self._detour: tuple[int, float] | None = None
        self._detours = 0

    def begin_leg(self, now: int) -> None:
        """Resets the progress for a new goal."""
        self._progress = (now, math.inf)

    def steer(
        self,
        pose: OdometrySample,
        to_goal: Array,
        memory: ObstacleMemory,
        now: int,
        top_speed: float,
    ) -> tuple[Array, float]:
        """Returns the level velocity (2,) m/s in the odometry frame, and the yaw rate, rad/s.

        to_goal: (2,) m from the UAV, odometry frame. now: ns.
        """
        distance = float(np.hypot(*to_goal))
        goal_angle = self._detoured(math.atan2(to_goal[1], to_goal[0]), distance, now)
        obstacles = memory.around(pose.position[:2], now, MAX_RANGE_M)
        free = free_distances(obstacles, self._caution.safe_radius_m, MAX_RANGE_M)
        heading = choose_heading(free, goal_angle, distance, self._last_heading)
        if heading is None:
            self._last_heading = None
            return np.zeros(2), 0.6
        self._last_heading = heading.angle
        speed = self._speed_limit(heading.free_m, distance, obstacles, top_speed)
        aside = float(wrap(np.array(heading.angle - pose.yaw)))
        if abs(aside) > self._caution.aside_rad:
            speed = min(speed, self._caution.aside_m_s)
        direction = np.array([math.cos(heading.angle), math.sin(heading.angle)])
        return speed * direction, max(-1.2, min(1.2, 1.8 * aside))

    def is_stuck(self, distance: float, now: int) -> bool:
        """Returns whether the goal, `distance` m away, has come no nearer for a while."""
        since, best = self._progress
        if distance < best - _STUCK_PROGRESS_M:
            self._progress = (now, distance)
            return False
        return now - since > _STUCK_AFTER_S * 1e9

    def _speed_limit(
        self, free_m: float, goal_m: float, obstacles: Array, top_speed: float
    ) -> float:
        stop_within = max(min(free_m - 0.3, goal_m), 0.05)
        speed = min(top_speed, math.sqrt(2.0 * self._caution.deceleration_m_s2 * stop_within))
        if len(obstacles):
            nearest = float(np.hypot(obstacles[:, 0], obstacles[:, 1]).min())
            speed = min(speed, max(0.4, 2.0 * (nearest - 0.4)))
        return speed

    def _detoured(self, goal_angle: float, distance: float, now: int) -> float:
        """Turns the goal direction for a while, left and right in turn, without progress."""
        if self._detour is not None and now < self._detour[0]:
            return goal_angle + self._detour[1]
        if self._detour is not None:
            self._detour = None
            self._progress = (now, distance)
        if self.is_stuck(distance, now):
            self._detours += 1
            side = 1.0 if self._detours % 2 else -1.0
            self._detour = (now + round(_DETOUR_S * 1e9), side * math.radians(100.0))
        return goal_angle
