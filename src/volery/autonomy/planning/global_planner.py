"""Plans a path through the map to a goal, and again when the map changes or progress stalls."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from volery.autonomy.mapping.messages import OCTOMAP, voxels_of
from volery.autonomy.perception.list_parameters import declare_numbers
from volery.autonomy.perception.map_frame import MAP, MapFrame
from volery.autonomy.perception.odometry_topics import subscribe_odometry
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.planning.global_path import PathSearch, plan_path
from volery.autonomy.planning.voxel_space import SolidVoxels, VoxelSpace
from volery.autonomy.status import publish_status
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import DataFileError, NodeError, PlanError
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import (
    Bool,
    Odometry,
    PathMessage,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    String,
    frame_of,
    header,
)
from volery.graph.nodes.node import Node

_LEVEL = Quaternion(0.0, 0.0, 0.0, 1.0)
_PERIOD_S = 1.0
_STUCK_S = 6.0
_STUCK_M = 1.0
"""The path is planned again after `_STUCK_S` without coming `_STUCK_M` nearer to the goal."""
_MARGIN_M = 25.0
_TRIES = 3
"""Attempts after which the goal is given up."""


class GlobalPlanner(SavedAttributes, Node):
    """Plans `planning/path` to `planning/goal` (PoseStamped, map).

    `planning/goal_status` is JSON: state (waiting, planned, refused, unreachable), reason, goal,
    length_m, plans. Without a map the path is straight. Service `~/stop` and `planning/pause`
    (std_msgs/Bool, true) cancel the goal; the UAV holds its position.

    Parameters
    ----------
    odometry: topic of the pose; `use_map_tf`: whether `/tf` holds the pose of its frame in the map.
    height_m: height above ground of the goal; heights_m: [min, max] along the path.
    safe_radius_m: min distance to obstacles. resolution_m: cell size of the planning space.
    max_iterations: bound of the search. seed: of its random numbers.

    """

    PARTS = ("_frame",)
    STATE = (
        "_goal",
        "_waypoints",
        "_position",
        "_since_ns",
        "_best_m",
        "_tries",
        "_plans",
        "_last_status",
        "_map",
    )

    WARMUP_TASKS = (
        "volery.autonomy.planning.warmup:path_planning",
        "volery.autonomy.mapping.warmup:read_maps",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("global_planner", **options)
        self._height = float(self.declare_parameter("height_m", 3.0, min_value=0.1).value)
        low, high = declare_numbers(self, "heights_m", [2.2, 4.2], "[minimum, maximum]")
        if not low < high:
            raise NodeError(f"heights_m must be [min, max] with min < max, not {[low, high]}")
        self._search = PathSearch(
            radius_m=float(self.declare_parameter("safe_radius_m", 0.8, min_value=0.05).value),
            heights_m=(low, high),
            iterations=int(self.declare_parameter("max_iterations", 4000, min_value=1).value),
        )
        self._cell = float(self.declare_parameter("resolution_m", 0.4, min_value=0.05).value)
        self._seed = int(self.declare_parameter("seed", 1).value)
        self._frame = MapFrame()
        self._map: SolidVoxels | None = None
        """Occupied voxels of the newest map."""
        self._goal: Array | None = None
        self._waypoints: Array | None = None
        self._position: Array | None = None
        """Position of the vehicle, (3,) m in the map."""
        self._since_ns = 0
        self._best_m = math.inf
        """Smallest distance to the goal so far, and since when it has not decreased."""
        self._tries = 0
        self._plans = 0
        self._last_status = ""
        self._open()

    def _open(self) -> None:
        self._path = self.create_publisher(PathMessage, "planning/path", 1, latched=True)
        self._status = self.create_publisher(String, "planning/goal_status", 1, latched=True)
        subscribe_odometry(self, self._frame, self._on_odometry, depth=1)
        self.create_subscription(PoseStamped, "planning/goal", self._on_goal, 1)
        self.create_subscription(OCTOMAP, "octomap_binary", self._on_map, 1)
        self.create_subscription(Bool, "planning/pause", self._on_pause, 1)
        self.create_service("std_srvs/srv/Trigger", "~/stop", self._on_stop)
        self.create_timer(_PERIOD_S, self._on_timer)

    # ------------------------------------------------------------------------------ subscriptions

    def _on_odometry(self, message: Odometry) -> None:
        self._frame.on_odometry(message)
        position = OdometrySample.from_odometry(message).position
        if np.isfinite(position).all():
            self._position = self._frame.to_map(position)

    def _on_goal(self, message: PoseStamped) -> None:
        p = message.pose.position
        goal = np.array([p.x, p.y, p.z], dtype=np.float64)
        if frame_of(message) not in ("", MAP):
            self._give_up("refused", f"goals are in 'map', not in '{frame_of(message)}'")
        elif not np.isfinite(goal).all():
            self._give_up("refused", "the goal's position is not finite")
        elif self._goal is None or not np.array_equal(goal, self._goal) or self._waypoints is None:
            self._goal, self._tries = goal, 0
            self._plan()

    def _on_map(self, message: Any) -> None:
        """Plans again if the new map shows that the path is no longer clear."""
        try:
            self._map = SolidVoxels.of(voxels_of(message), float(message.resolution))
        except DataFileError as error:
            self._publish_status(
                "waiting" if self._waypoints is None else "planned", str(error), 0.0
            )
            return
        if self._goal is None or self._waypoints is None or self._position is None:
            return
        try:
            space = self._space(self._position)
        except PlanError as error:
            self._give_up("refused", str(error))
            return
        if space is not None and not self._is_clear(space, self._waypoints, self._position):
            self._plan()

    def _on_pause(self, message: Bool) -> None:
        """Cancels the goal: after a pause the client sends a goal again."""
        if message.data:
            self._goal = None
            self._give_up("waiting", "paused")

    def _on_stop(self, _request: Any, response: Any) -> Any:
        self._goal = None
        self._give_up("waiting", "stopped by request")
        response.success, response.message = True, ""
        return response

    # ----------------------------------------------------------------------------------- planning

    def _on_timer(self) -> None:
        """Plans again if the vehicle comes no nearer to the goal."""
        if self._goal is None or self._position is None:
            return
        now = self.get_clock().now_ns()
        if self._waypoints is None:
            if self._tries == 0:
                self._plan()
            return
        left = float(np.hypot(*(self._goal[:2] - self._position[:2])))
        if left < self._best_m - _STUCK_M or left < 2.0:
            self._best_m, self._since_ns, self._tries = left, now, 0
        elif now - self._since_ns > _STUCK_S * NS_PER_S:
            self._tries += 1
            if self._tries > _TRIES:
                self._give_up("unreachable", f"no path to the goal after {_TRIES} attempts")
            else:
                self._plan()

    def _plan(self) -> None:
        goal, position = self._goal, self._position
        if goal is None or position is None:
            return
        self._plans += 1
        try:
            space = self._space(position)
            if space is None:
                waypoints = np.stack([position, goal])
            else:
                seed = self._seed * 1_000_003 + self._plans
                waypoints = plan_path(space, position, goal, self._height, self._search, seed)
        except PlanError as error:
            self._give_up("refused", str(error))
            return
        self._waypoints = waypoints
        self._since_ns = self.get_clock().now_ns()
        self._best_m = float(np.hypot(*(goal[:2] - position[:2])))
        self._send(waypoints)
        length = float(np.linalg.norm(np.diff(waypoints, axis=0), axis=1).sum())
        self._publish_status(
            "planned", "" if space is not None else "no map there: straight path", length
        )

    def _space(self, position: Array) -> VoxelSpace | None:
        """Returns the space of the map around vehicle and goal; None where the map holds nothing.

        Each failed attempt widens it. Raises PlanError if vehicle and goal are too far apart.
        """
        assert self._goal is not None
        if self._map is None:
            return None
        around, margin = np.stack([position, self._goal]), _MARGIN_M * (1 + self._tries)
        if not self._map.is_near(around, margin):
            return None
        return VoxelSpace(self._map, self._cell, around, margin)

    def _is_clear(self, space: VoxelSpace, waypoints: Array, position: Array) -> bool:
        """Returns whether the rest of a path is free."""
        heights = np.array([space.ground_at(p[:2]) for p in waypoints])
        states = waypoints.copy()
        states[:, 2] -= heights
        nearest = int(np.argmin(np.hypot(*(waypoints[:, :2] - position[:2]).T)))
        radius = 0.75 * self._search.radius_m
        legs = zip(states[nearest:-1], states[nearest + 1 :], strict=True)
        return all(space.is_free_between(a, b, radius) for a, b in legs)

    # ---------------------------------------------------------------------------------- publishers

    def _give_up(self, state: str, reason: str) -> None:
        """Publishes the reason and an empty path, so that the vehicle stops."""
        self._tries, self._waypoints = max(self._tries, 1), None
        self._send(np.zeros((0, 3)))
        self._publish_status(state, reason, 0.0)

    def _send(self, waypoints: Array) -> None:
        stamp = header(self.get_clock().now_ns(), MAP)
        poses = [
            PoseStamped(stamp, Pose(Point(*waypoint), _LEVEL)) for waypoint in waypoints.tolist()
        ]
        self._path.publish(PathMessage(stamp, poses))

    def _publish_status(self, state: str, reason: str, length_m: float) -> None:
        goal = None if self._goal is None else [round(v, 2) for v in self._goal.tolist()]
        status = {"state": state, "reason": reason, "goal": goal, "length_m": round(length_m, 1)}
        status = {**status, "plans": self._plans}
        self._last_status = publish_status(self._status, status, self._last_status)
