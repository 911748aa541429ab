"""Flies a route through a forest by two LIDARs, a sonar and odometry; see `gap_flight`."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import Any

import numpy as np

from volery.autonomy.avoidance.gap_flight import GapFlight
from volery.autonomy.avoidance.stop import Stop
from volery.autonomy.perception.list_parameters import declare_points
from volery.autonomy.perception.scan_points import OdometrySample
from volery.core.arrays import Array
from volery.graph.messages import String

_PERIOD_S = 0.05
_MIN_CLIMB_M = 1.0
_AT_LANDING_POSITION_M = 0.6
"""Distance from its landing position within which the UAV stops."""
_CLEAR_M, _WANTED_CLEAR_M = 1.0, 1.2
"""Distance from growth at which the UAV lands, and with which a position is chosen."""
_MAX_LANDING_POSITIONS = 4
"""Positions that the UAV tries before it lands where it is (modelling choice)."""


class GapFollowingPhase(StrEnum):
    """Phase of the mission."""

    START = "start"
    CLIMB = "climb"
    FLY = "fly"
    SETTLE = "settle"
    LAND = "land"


class GapFollowing(GapFlight):
    """Takes off, visits `route`, lands.

    Parameters
    ----------
    route: list of [x, y] waypoints, m, relative to the take-off position.

    The others are those of `GapFlight`.

    """

    STATE = (
        *("_phase", "_home", "_next_waypoint", "_settle_at", "_stop", "_num_landing_positions"),
        *GapFlight.STATE,
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("gap_following", **options)
        route = declare_points(self, "route", [[50.0, 0.0]])
        self._route = [np.array(point, dtype=np.float64) for point in route]
        self._phase = GapFollowingPhase.START
        self._home = np.zeros(3)
        self._next_waypoint = 0
        self._settle_at: Array | None = None
        self._stop = Stop()
        self._num_landing_positions = 0
        """Landing positions chosen so far."""
        self._status = self.create_publisher(String, "~/phase", 1)
        self._take_off = self.create_client("std_srvs/srv/Trigger", "take_off")
        self._land = self.create_client("std_srvs/srv/Trigger", "land")
        self.create_timer(_PERIOD_S, self._on_timer)

    def _on_timer(self) -> None:
        if self._pose is None:
            return
        step = {
            GapFollowingPhase.START: self._start,
            GapFollowingPhase.CLIMB: self._climb,
            GapFollowingPhase.FLY: self._fly,
            GapFollowingPhase.SETTLE: self._settle,
            GapFollowingPhase.LAND: self._wait,
        }[self._phase]
        step(self._pose)
        if self._status.has_subscribers:
            self._status.publish(String(str(self._phase)))

    def _start(self, pose: OdometrySample) -> None:
        if self._take_off.service_is_ready() and self._take_off.call().success:
            self._home = pose.position.copy()
            self._ground.height = float(pose.position[2])
            self._ground.anchor = pose.position[:2].copy()
            self._phase = GapFollowingPhase.CLIMB

    def _climb(self, pose: OdometrySample) -> None:
        self._refit_ground(pose)
        climbed = float(pose.position[2] - self._home[2])
        has_stopped = climbed > _MIN_CLIMB_M and abs(pose.velocity[2]) < 0.1
        if has_stopped or climbed > self._height - 0.5:
            self._phase = GapFollowingPhase.FLY

    def _fly(self, pose: OdometrySample) -> None:
        self._refit_ground(pose)
        to_goal = self._home[:2] + self._route[self._next_waypoint] - pose.position[:2]
        distance, now = float(np.hypot(*to_goal)), self.get_clock().now_ns()
        if distance < 2.0 or (distance < 6.0 and self._steering.is_stuck(distance, now)):
            self._next_waypoint += 1
            self._steering.begin_leg(now)
            if self._next_waypoint == len(self._route):
                self._phase = GapFollowingPhase.SETTLE
                self._settle_at = self._landing_position(pose)
            return
        self._go_towards(pose, to_goal)

    def _settle(self, pose: OdometrySample) -> None:
        """Flies to a position without low growth, stops, and lands if there is none below it."""
        self._refit_ground(pose)
        assert self._settle_at is not None
        now = self.get_clock().now_ns()
        offset = self._settle_at - pose.position[:2]
        distance = float(np.hypot(*offset))
        if distance < _AT_LANDING_POSITION_M or self._steering.is_stuck(distance, now):
            self._stop.begin(now)
        if not self._stop.has_begun:
            self._go_towards(pose, offset)
            return
        self._publish(pose, np.zeros(2), 0.0)
        if not self._stop.is_over(pose, now):
            return
        if (
            self._clearance(pose, np.zeros(2)) < _CLEAR_M
            and self._num_landing_positions < _MAX_LANDING_POSITIONS
        ):
            self._settle_at = self._landing_position(pose)
            self._steering.begin_leg(now)
            self._stop = Stop()
        elif self._land.call().success:
            self._phase = GapFollowingPhase.LAND

    def _wait(self, pose: OdometrySample) -> None:
        """Does nothing: the flight mode lands the UAV."""

    def _landing_position(self, pose: OdometrySample) -> Array:
        """Returns the nearest position (2,) m within 8 m without growth within 1.2 m."""
        self._num_landing_positions += 1
        best, best_cost = np.zeros(2), math.inf
        for radius in np.arange(0.0, 8.1, 1.0):
            for angle in np.arange(0.0, 2.0 * math.pi, math.pi / 8.0):
                offset = radius * np.array([math.cos(angle), math.sin(angle)])
                gap = self._clearance(pose, offset)
                cost = float(radius) + 20.0 * max(0.0, _WANTED_CLEAR_M - gap)
                if cost < best_cost:
                    best, best_cost = offset, cost
        return np.asarray(pose.position[:2] + best)

    def _clearance(self, pose: OdometrySample, offset: Array) -> float:
        """Returns the distance from growth, m, of a position (2,) m from the UAV."""
        growth = self._low_obstacles.around(pose.position[:2], self.get_clock().now_ns(), 10.0)
        return float(np.hypot(*(growth - offset).T).min()) if len(growth) else math.inf
