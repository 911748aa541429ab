"""Searches an area: sends goals until all of the area has been observed."""

from __future__ import annotations

import json
import math
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.mapping.messages import grid_values_message
from volery.autonomy.perception.map_frame import MAP, MapFrame
from volery.autonomy.perception.odometry_topics import subscribe_odometry
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.planning.search_area import SearchArea
from volery.autonomy.planning.viewpoints import Viewpoint, next_viewpoint
from volery.autonomy.status import publish_status
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import PlanError
from volery.core.plurals import counted
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import (
    Float32,
    OccupancyGrid,
    Odometry,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    String,
    frame_of,
    header,
    message_type,
    single,
)
from volery.graph.nodes.node import Node

POLYGON: type[Any] = message_type("geometry_msgs/msg/PolygonStamped")
_LEVEL = Quaternion(0.0, 0.0, 0.0, 1.0)
_PERIOD_S = 0.5
_NEAR = 0.3
"""Fraction of the view radius at which a goal counts as reached, so that the flight does not
stop.
"""
_STALE = 0.15
"""A goal is dropped when only this fraction of its expected gain is still new."""
_BLOCKED_S = 8.0
"""A goal is given up after this time without progress towards it."""
_NEARER_M = 1.0


class ExplorationState(StrEnum):
    """State of the search."""

    WAITING = "waiting"
    SEARCHING = "searching"
    DONE = "done"
    BLOCKED = "blocked"


class Exploration(SavedAttributes, Node):
    """Searches `search_area` by `planning/goal`; publishes `exploration/status` and `/covered`.

    `search_area` is geometry_msgs/PolygonStamped in the map; a new one replaces it, an empty one
    ends the search. The status is JSON: state (waiting, searching, done, blocked), reason, covered
    (fraction), area_m2, searched_m2, goal, given_up. `exploration/covered` is std_msgs/Float32, the
    fraction; `exploration/searched` nav_msgs/OccupancyGrid: 0 unobserved, 100 observed, -1 outside.

    Parameters
    ----------
    odometry: topic of the pose; `use_map_tf`: whether `/tf` holds the pose of its frame in the map.
    view_radius_m: radius around the vehicle that counts as observed.
    resolution_m: cell size of the area.

    """

    PARTS = ("_frame",)
    STATE = (
        "_motion",
        "_area",
        "_grid",
        "_goal",
        "_since_ns",
        "_best_m",
        "_refused",
        "_visited",
        "_state",
        "_reason",
        "_last_status",
        "_sent",
    )

    WARMUP_TASKS = ("volery.autonomy.planning.warmup:searched_area",)

    def __init__(self, **options: Any) -> None:
        super().__init__("exploration", **options)
        self._view = float(self.declare_parameter("view_radius_m", 10.0, min_value=0.1).value)
        self._cell = float(self.declare_parameter("resolution_m", 1.0, min_value=0.05).value)
        self._frame = MapFrame()
        self._motion: OdometrySample | None = None
        self._area: SearchArea | None = None
        self._grid: tuple[NDArray[np.int8], Array, float] | None = None
        """Values of the map at flight height, (2,) m lower left corner, cell size in m."""
        self._goal: Viewpoint | None = None
        self._since_ns = 0
        self._best_m = math.inf
        self._refused: list[Array] = []
        self._visited: list[Array] = []
        """Goals that could not be reached, and viewpoints that have been visited; (2,) m in the
        map.
        """
        self._state, self._reason = ExplorationState.WAITING, "no area"
        self._last_status = ""
        self._sent = 0
        self._open()

    def _open(self) -> None:
        self._goals = self.create_publisher(PoseStamped, "planning/goal", 1)
        self._status = self.create_publisher(String, "exploration/status", 1, latched=True)
        self._covered = self.create_publisher(Float32, "exploration/covered", 1)
        self._searched = self.create_publisher(
            OccupancyGrid, "exploration/searched", 1, latched=True
        )
        subscribe_odometry(self, self._frame, self._on_odometry, depth=1)
        self.create_subscription(POLYGON, "search_area", self._on_area, 1)
        self.create_subscription(OccupancyGrid, "projected_map", self._on_grid, 1)
        self.create_subscription(String, "planning/goal_status", self._on_goal_status, 5)
        self.create_timer(_PERIOD_S, self._on_timer)
        self.create_timer(2.0, self._publish_searched)

    # ------------------------------------------------------------------------------ subscriptions

    def _on_odometry(self, message: Odometry) -> None:
        self._frame.on_odometry(message)
        motion = OdometrySample.from_odometry(message)
        if np.isfinite(motion.position).all() and np.isfinite(motion.velocity).all():
            self._motion = motion

    def _on_area(self, message: Any) -> None:
        corners = np.array([[p.x, p.y] for p in message.polygon.points], dtype=np.float64)
        self._goal, self._refused, self._visited = None, [], []
        if frame_of(message) not in ("", MAP):
            self._area = None
            self._become(ExplorationState.WAITING, f"areas are in 'map', not '{frame_of(message)}'")
            return
        if len(corners) == 0:
            self._area = None
            self._become(ExplorationState.WAITING, "no area")
            return
        try:
            area = SearchArea(corners, self._cell)
        except PlanError as error:
            self._area = None
            self._become(ExplorationState.WAITING, str(error))
            return
        self._area = area
        self._become(ExplorationState.SEARCHING, "")

    def _on_grid(self, message: OccupancyGrid) -> None:
        info = message.info
        values = np.asarray(message.data, np.int8)
        if info.resolution <= 0.0 or values.size != info.height * info.width:
            self._reason = "the map's size does not match its data"
            return
        corner = np.array([info.origin.position.x, info.origin.position.y])
        self._grid = (values.reshape(info.height, info.width), corner, float(info.resolution))

    def _on_goal_status(self, message: String) -> None:
        """Gives up the goal if the planner cannot reach it."""
        try:
            status = json.loads(message.data)
            state, goal = status["state"], status["goal"]
        except (ValueError, TypeError, KeyError):
            return
        if self._goal is None or state not in ("refused", "unreachable"):
            return
        if goal is not None and np.hypot(*(self._goal.position - goal[:2])) < 0.1:
            self._give_up()

    # ------------------------------------------------------------------------------------- search

    def _on_timer(self) -> None:
        if self._area is None or self._motion is None or self._grid is None:
            self._publish_status()
            return
        if self._frame.is_lost:
            self._since_ns = self.get_clock().now_ns()  # a goal is not blocked by lost tracking
            return
        position = self._frame.to_map(self._motion.position)
        self._area.look(position, *self._grid, self._view)
        if self._state is ExplorationState.SEARCHING:
            self._search(self._area, position)
        self._covered.publish(Float32(single(self._area.covered_fraction)))
        self._publish_status()

    def _search(self, area: SearchArea, position: Array) -> None:
        now = self.get_clock().now_ns()
        if self._goal is not None:
            away = float(np.hypot(*(self._goal.position - position[:2])))
            gain = float(area.gains(self._goal.position[None], self._view)[0][0])
            if away < _NEAR * self._view:
                self._visited.append(self._goal.position)
                self._goal = None
            elif gain < _STALE * self._goal.gain_m2:
                self._goal = None
            elif away < self._best_m - _NEARER_M:
                self._best_m, self._since_ns = away, now
            elif now - self._since_ns > _BLOCKED_S * NS_PER_S:
                self._give_up()
        if self._goal is None:
            self._choose(area, position, now)

    def _choose(self, area: SearchArea, position: Array, now: int) -> None:
        assert self._motion is not None
        moving = self._frame.to_map(self._motion.position + self._motion.velocity) - position
        speed = float(np.hypot(*moving[:2]))
        heading = math.atan2(moving[1], moving[0]) if speed > 0.5 else self._motion.yaw
        left_out = [*self._refused, *self._visited]
        self._goal = next_viewpoint(area, position[:2], heading, self._view, left_out)
        if self._goal is not None:
            self._best_m, self._since_ns = math.inf, now
            self._send(np.array([*self._goal.position, position[2]]))
            return
        if next_viewpoint(area, position[:2], heading, self._view, self._visited) is not None:
            self._become(
                ExplorationState.BLOCKED,
                f"{counted(len(self._refused), 'viewpoint')} cannot be reached",
            )
        else:
            self._become(ExplorationState.DONE, "")
        self._send(position)

    def _give_up(self) -> None:
        assert self._goal is not None
        self._refused.append(self._goal.position)
        self._goal = None

    # ---------------------------------------------------------------------------------- publishers

    def _send(self, position: Array) -> None:
        stamp = header(self.get_clock().now_ns(), MAP)
        self._goals.publish(PoseStamped(stamp, Pose(Point(*position.tolist()), _LEVEL)))
        self._sent += 1

    def _become(self, state: ExplorationState, reason: str) -> None:
        self._state, self._reason = state, reason

    def _publish_status(self) -> None:
        area, goal = self._area, self._goal
        status = {
            "state": str(self._state),
            "reason": self._reason,
            "covered": 0.0 if area is None else round(area.covered_fraction, 3),
            "area_m2": 0.0 if area is None else area.size_m2,
            "searched_m2": 0.0 if area is None else area.seen_m2,
            "goal": None if goal is None else [round(v, 2) for v in goal.position.tolist()],
            "given_up": len(self._refused),
        }
        self._last_status = publish_status(self._status, status, self._last_status)

    def _publish_searched(self) -> None:
        if self._area is None or not self._searched.has_subscribers:
            return
        area = self._area
        values = np.where(area.inside, np.where(area.seen, 100, 0), -1).astype(np.int8).T
        corner = (float(area.low[0]), float(area.low[1]), 0.0)
        now = self.get_clock().now_ns()
        self._searched.publish(
            grid_values_message(np.ascontiguousarray(values), area.cell_m, corner, MAP, now)
        )
