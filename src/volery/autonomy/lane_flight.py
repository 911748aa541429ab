"""Sweep a search area in lanes, through the gaps between trees; see `gap_flight`.

The plain explorer: it needs no map, and asks for nothing but what `GapFlight` sees.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.gap_flight import GapFlight
from volery.autonomy.scan_points import Pose
from volery.core.clock import NS_PER_S
from volery.graph.messages import PolygonStamped, PoseStamped, message_type

Array = NDArray[np.float64]

_PERIOD_S = 0.05
_THERE_M, _NEARLY_M = 2.0, 8.0
_SKIP_S = 25.0
"""A waypoint that is not reached within this time and the way to it is left out."""
_MATE_S, _YIELD_M = 1.0, 6.0
"""A UAV that was heard so lately and is so near is given way to by those whose name comes after."""
"""All modelling choices."""


class LaneFlight(GapFlight):
    """Sweeps the newest `search_area`, or flies to the newest goal; hovers where there is none.

    Neither takes off nor lands. `radio/team` tells it of UAVs near by: of two the one whose name
    comes first goes on, and sees the other as an obstacle.

    Parameters
    ----------
    lane_m: distance between lanes.
    goal_topic: where goals come from.

    The others are those of `GapFlight`.

    """

    STATE = ("_has_begun", "_way", "_leg_ns", "_leg_s", "_mates", *GapFlight.STATE)

    def __init__(self, **options: Any) -> None:
        super().__init__("lane_flight", **options)
        self._lane_m = float(self.declare_parameter("lane_m", 10.0).value)
        goal_topic = str(self.declare_parameter("goal_topic", "planning/goal").value)
        self._has_begun = False
        self._way: list[Array] = []
        """Waypoints (2,) that are left."""
        self._leg_ns = 0
        self._leg_s = 0.0
        """When the way to the next one began, and how long it may take."""
        self._mates: dict[str, tuple[int, Array]] = {}
        """When each was heard, ns, and where it was."""
        report = message_type("volery_interfaces/msg/TeamReport")
        self.create_subscription(PolygonStamped, "search_area", self._on_area, 1)
        self.create_subscription(PoseStamped, goal_topic, self._on_goal, 1)
        self.create_subscription(report, "radio/team", self._on_report, 20)
        self.create_timer(_PERIOD_S, self._on_timer)

    # ------------------------------------------------------------------------------ what it hears

    def _on_area(self, message: PolygonStamped) -> None:
        corners = np.array([[p.x, p.y] for p in message.polygon.points]).reshape(-1, 2)
        place = np.zeros(2) if self._pose is None else self._pose.position[:2]
        self._set_out(lanes(corners, self._lane_m, place))

    def _on_goal(self, message: PoseStamped) -> None:
        p = message.pose.position
        self._set_out([np.array([p.x, p.y])])

    def _on_report(self, report: Any) -> None:
        p = report.position
        self._mates[report.name] = (self.get_clock().now_ns(), np.array([p.x, p.y]))

    # ------------------------------------------------------------------------------- what it does

    def _set_out(self, way: list[Array]) -> None:
        self._way = way
        self._begin_leg()

    def _begin_leg(self) -> None:
        self._leg_ns = self.get_clock().now_ns()
        self._steering.begin_leg(self._leg_ns)
        self._leg_s = _SKIP_S
        if self._way and self._pose is not None:
            way = float(np.hypot(*(self._way[0] - self._pose.position[:2])))
            self._leg_s += 2.0 * way / float(self._speed_m_s.value)

    def _on_timer(self) -> None:
        pose = self._pose
        if pose is None:
            return
        if not self._has_begun:  # most often it stands on the ground now
            self._has_begun = True
            self._ground.height = float(pose.position[2])
            self._ground.anchor = pose.position[:2].copy()
        self._refit_ground(pose)
        if self._way and self._is_done_with(self._way[0] - pose.position[:2]):
            self._way.pop(0)
            self._begin_leg()
        if self._way and not self._gives_way(pose):
            self._go_towards(pose, self._way[0] - pose.position[:2])
        else:
            self._publish(pose, np.zeros(2), 0.0)

    def _is_done_with(self, to_goal: Array) -> bool:
        now, away = self.get_clock().now_ns(), float(np.hypot(*to_goal))
        late = now - self._leg_ns > self._leg_s * NS_PER_S
        is_last = len(self._way) == 1
        reached = away < (1.0 if is_last else _THERE_M)
        return reached or (
            not is_last and (late or (away < _NEARLY_M and self._steering.is_stuck(away, now)))
        )

    def _gives_way(self, pose: Pose) -> bool:
        now, own = self.get_clock().now_ns(), self.get_namespace().strip("/")
        return any(
            name < own
            and now - heard_ns <= _MATE_S * NS_PER_S
            and float(np.hypot(*(place - pose.position[:2]))) < _YIELD_M
            for name, (heard_ns, place) in self._mates.items()
        )


def lanes(corners: Array, lane_m: float, start: Array) -> list[Array]:
    """Waypoints (2,) of a sweep over the rectangle around `corners` (K, 2), to and fro.

    The lanes lie along its longer side, half a lane inside of it; the sweep begins at the end that
    is nearest to `start` (2,).
    """
    if not len(corners):
        return []
    low, high = corners.min(axis=0), corners.max(axis=0)
    across = int(np.argmin(high - low))
    count = max(math.ceil((high[across] - low[across]) / lane_m - 1e-9), 1)
    spacing = (high[across] - low[across]) / count
    inset = min(0.5 * spacing, 0.5 * (high[1 - across] - low[1 - across]))
    ends = low[1 - across] + inset, high[1 - across] - inset
    way = []
    for k in range(count):
        level = low[across] + (k + 0.5) * spacing
        for end in ends if k % 2 == 0 else ends[::-1]:
            point = np.empty(2)
            point[across], point[1 - across] = level, end
            way.append(point)
    mirrored = []
    for point in way:
        other = point.copy()
        other[1 - across] = ends[0] + ends[1] - point[1 - across]
        mirrored.append(other)
    sweeps = [way, way[::-1], mirrored, mirrored[::-1]]
    return min(sweeps, key=lambda sweep: float(np.hypot(*(sweep[0] - start))))
