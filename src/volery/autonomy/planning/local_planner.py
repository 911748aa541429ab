"""Plans the trajectory of the next seconds from sensor data."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from volery.autonomy.perception.list_parameters import declare_mount
from volery.autonomy.perception.map_frame import MAP, UNKNOWN_POSE, MapFrame
from volery.autonomy.perception.odometry_topics import subscribe_odometry
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.planning.neighbours import Neighbours
from volery.autonomy.planning.primitives import MotionLimits, PrimitivePath, PrimitiveState
from volery.autonomy.planning.receding_horizon import (
    Observations,
    PlannerSettings,
    PlannerState,
    RecedingHorizonPlanner,
)
from volery.autonomy.planning.reciprocal_avoidance import Separation, half_planes
from volery.autonomy.planning.surroundings import Surroundings
from volery.autonomy.planning.tracking_error import TrackingError
from volery.autonomy.planning.trajectory_messages import trajectory_message
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S, ns_from_s
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm
from volery.graph.messages import (
    Bool,
    JointState,
    LaserScan,
    MultiDOFJointTrajectory,
    Odometry,
    PathMessage,
    Range,
    String,
    frame_of,
    message_type,
)
from volery.graph.nodes.node import Node


class PathLookahead:
    """Tracks progress along positions (K, 3) m, K > 0; progress never decreases."""

    def __init__(self, waypoints: Array, passed_m: float = 0.0) -> None:
        self.waypoints = waypoints
        lengths = np.linalg.norm(np.diff(waypoints[:, :2], axis=0), axis=1)
        self._along = np.concatenate([[0.0], np.cumsum(lengths)])
        self.passed_m = min(passed_m, float(self._along[-1]))
        """Progress along the path, m."""

    @property
    def goal(self) -> Array:
        """Returns the end of the path, (3,) m."""
        return np.asarray(self.waypoints[-1])

    def left_m(self, position: Array) -> float:
        """Returns the distance (m) along the path to its end, from a position beside it."""
        return float(
            self._along[-1] - self.passed_m + np.hypot(*(self._at(self.passed_m) - position[:2]))
        )

    def lookahead_point(self, position: Array, ahead_m: float, search_m: float = 15.0) -> Array:
        """Updates the progress and returns the point (2,) m `ahead_m` further along the path.

        Progress becomes the point nearest to `position` within the next `search_m`.
        """
        steps = np.arange(self.passed_m, min(self.passed_m + search_m, self._along[-1]) + 0.25, 0.5)
        away = np.hypot(*(self._at(steps) - position[:2, None]))
        self.passed_m = float(min(steps[int(np.argmin(away))], self._along[-1]))
        return self._at(min(self.passed_m + ahead_m, self._along[-1]))

    def _at(self, along: float | Array) -> Array:
        """Returns the point (2, ...) at a distance along the path."""
        return np.array(
            [np.interp(along, self._along, self.waypoints[:, axis]) for axis in range(2)]
        )


_LOOKAHEAD_M = 9.0
"""Distance of the lookahead point along the path; the planning window extends to 12 m."""
_MIN_HEIGHT_M = 1.0
"""Height above ground below which the planner is inactive: the vehicle takes off or lands."""
_STOPPING_M, _MIN_SPEED = 1.5, 0.3
"""Margin for disturbances at which the speed would be zero, m; smallest fraction of it."""
_MAX_RADIUS_M = 1.5
"""Largest radius with its margin, m: distances are measured up to 1.75 m."""
_DISTURBED_M = 0.2
"""Margin for disturbances from which the status mentions it, m."""
PUSHED = "the UAV is pushed off its plans: it flies slower, farther from obstacles"
TOO_DISTURBED = "disturbances push the UAV too far off its plans"
_STATUS_PERIOD_S = 1.0
"""Period of the status; changes of state or problems are published at once."""


class LocalPlanner(SavedAttributes, Node):
    """Follows `planning/path` by `planning/trajectory`; publishes `planning/status`.

    An empty path makes the UAV hold. The status is JSON: state (waiting, holding, flying, turning,
    blocked, arrived, paused), problems, left_m, clearance_m, plans, off_m (largest deviation from
    plans of the last half minute). The UAV holds while that is too large. `planning/pause`
    (std_msgs/Bool, true) stops planning and clears the path.

    Parameters
    ----------
    odometry: topic of the pose; `use_map_tf`: whether `/tf` holds the pose of its frame in the map.
    level_mount, nodding_mount: [x, y, z] of the LIDARs in the body, m.
    height_m: height above ground to fly at; speed_m_s: max speed. Both may be set in flight.
    acceleration_m_s2: max horizontal acceleration.
    safe_radius_m: min distance of the UAV's centre to obstacles, at rest; 0.1 m more for each m/s,
        and more if disturbances push the UAV off its plans.
    avoid_unknown: whether plans avoid unknown space.
    period_s: time between plans. start_delay_s: time from a plan's input to its start; not less
        than the node's latency.
    acceptance_radius_m: distance to the end at which the path is done.
    scan_rate_hz: scans processed per second and LIDAR. It should be no multiple of a nodding
        mount's rate, else all scans show the same angles. All scans of a nodding LIDAR add hits.
    resolution_m: cell size of the local grid.
    separation_m: horizontal distance to keep from the UAVs that report on `radio/team`.

    """

    PARTS = ("_sight", "_planning", "_tracking", "_frame")
    STATE = (
        "_lookahead",
        "_path_map",
        "_neighbours",
        "_last_status",
        "_last_status_ns",
        "_plans",
        "_frame_was",
        "_paused",
        "_is_faulty",
    )

    WARMUP_TASKS = (
        "volery.autonomy.planning.warmup:plans",
        "volery.autonomy.perception.warmup:scan_repeats",
        "volery.autonomy.perception.warmup:scan_rays",
        "volery.autonomy.perception.warmup:ground",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("local_planner", **options)
        mounts = {name: declare_mount(self, name) for name in ("level", "nodding")}
        cell = float(
            self.declare_parameter("resolution_m", 0.25, min_value=0.05, max_value=5.0).value
        )
        scan_rate = float(
            self.declare_parameter("scan_rate_hz", 13.3, min_value=0.1, max_value=1000.0).value
        )
        self._sight = Surroundings(mounts, cell, scan_rate)
        self._height = self.declare_parameter("height_m", 3.0, min_value=0.1, read_only=False)
        self._speed = self.declare_parameter("speed_m_s", 3.0, min_value=0.1, read_only=False)
        self._acceleration = float(
            self.declare_parameter("acceleration_m_s2", 2.5, min_value=0.1).value
        )
        self._radius = float(self.declare_parameter("safe_radius_m", 0.6, min_value=0.05).value)
        self._avoid_unknown = bool(self.declare_parameter("avoid_unknown", True).value)
        self._start_delay_ns = ns_from_s(
            float(self.declare_parameter("start_delay_s", 0.1, min_value=0.0, max_value=10.0).value)
        )
        self._acceptance_radius_m = float(
            self.declare_parameter("acceptance_radius_m", 1.0, min_value=0.01).value
        )
        radius = float(self.declare_parameter("separation_m", 2.0, min_value=0.0).value)
        self._separation = Separation(radius_m=radius)
        self._tracking = TrackingError()
        self._is_faulty = False
        """Whether inputs were missing or wrong at the last tick."""
        self._planning = RecedingHorizonPlanner(self._policy())
        self._frame = MapFrame()
        self._frame_was: Any = None
        self._lookahead: PathLookahead | None = None
        self._path_map: Array | None = None
        """Positions of the path in the map, (K, 3) m; `_lookahead` is computed from them."""
        self._neighbours = Neighbours()
        self._last_status = ""
        self._last_status_ns = 0
        self._plans = 0
        self._paused = False
        self._open()

    def _open(self) -> None:
        period = float(
            self.declare_parameter("period_s", 0.18, min_value=0.01, max_value=60.0).value
        )
        self._trajectory = self.create_publisher(MultiDOFJointTrajectory, "planning/trajectory", 1)
        self._status = self.create_publisher(String, "planning/status", 1, latched=True)
        subscribe_odometry(self, self._frame, self._on_odometry, depth=5)
        for name, topic in (("level", "horizontal"), ("nodding", "nodding")):
            scans = f"laser/{topic}/scan"
            self.create_subscription(LaserScan, scans, self._scan_listener(name), 5)
        self.create_subscription(JointState, "joint_states", self._sight.on_joint, 5)
        self.create_subscription(Range, "range", self._on_range, 5)
        self.create_subscription(PathMessage, "planning/path", self._on_path, 1)
        report = message_type("volery_interfaces/msg/TeamReport")
        self.create_subscription(report, "radio/team", self._on_report, 20)
        self.create_subscription(Bool, "planning/pause", self._on_pause, 1)
        self.create_timer(period, self._on_timer)

    # ------------------------------------------------------------------------------ subscriptions

    def _on_odometry(self, message: Odometry) -> None:
        self._frame.on_odometry(message)
        self._sight.motion.add(OdometrySample.from_odometry(message))

    def _scan_listener(self, name: str) -> Callable[[LaserScan], None]:
        return lambda scan: self._sight.on_scan(name, scan, self.get_clock().now_ns())

    def _on_range(self, message: Range) -> None:
        self._sight.on_range(message, self.get_clock().now_ns())

    def _on_path(self, message: PathMessage) -> None:
        positions = [
            [p.pose.position.x, p.pose.position.y, p.pose.position.z] for p in message.poses
        ]
        found = np.array(positions, dtype=np.float64).reshape(-1, 3)
        if frame_of(message) not in ("", MAP) or not np.isfinite(found).all():
            self._publish_status(
                "refused",
                ["a path whose frame is not 'map', or with positions that are not finite"],
            )
            return
        self._path_map = found if len(found) else None
        self._lookahead = None

    def _on_pause(self, message: Bool) -> None:
        self._paused = bool(message.data)
        self._path_map = self._lookahead = None

    def _on_report(self, report: Any) -> None:
        self._neighbours.on_report(report, self.get_clock().now_ns())

    # ----------------------------------------------------------------------------------- planning

    def _on_timer(self) -> None:
        now = self.get_clock().now_ns()
        pose, problems = self._sight.motion.newest, self._sight.problems(now)
        if self._frame.is_lost:
            problems.append(UNKNOWN_POSE)
        if pose is None:
            self._publish_status("waiting", problems)
            return
        height = self._sight.height_above_ground(pose, now)
        present = PrimitiveState(pose.position, pose.velocity, np.zeros(3))
        then = now + self._start_delay_ns
        if self._paused:
            self._planning.forget()
            self._publish_status("paused", problems)
            return
        if height < _MIN_HEIGHT_M:
            self._planning.forget()
            self._publish_status("waiting", ["too low above ground to plan", *problems])
            return
        if self._path_map is None and not self._plans:
            self._publish_status("waiting", ["no path", *problems])
            return
        if problems:
            self._tracking.retract()
        elif self._is_faulty:
            self._planning.forget()  # what moved the vehicle meanwhile is no deviation from a plan
        else:
            self._measure_tracking(pose, now)
        self._is_faulty = bool(problems)
        if self._tracking.is_too_large:
            problems.append(TOO_DISTURBED)
        self._planning.policy = self._policy()
        start = self._planning.start(present, pose.yaw, now, then)
        if problems or self._lookahead_here() is None:
            self._publish(self._planning.hold(start, then), then)
            self._publish_status("holding", problems)
            return
        self._plan(pose, start, now, then)

    def _measure_tracking(self, pose: OdometrySample, now: int) -> None:
        planned = self._planning.state_at(now)
        if planned is not None:
            off = planned.position - pose.position_at(now)
            self._tracking.add(norm(off[:2]), now)

    def _plan(self, pose: OdometrySample, start: PrimitiveState, now: int, then: int) -> None:
        lookahead = self._lookahead_here()
        assert lookahead is not None
        lookahead_point = lookahead.lookahead_point(pose.position, _LOOKAHEAD_M)
        if lookahead.left_m(pose.position) < self._acceptance_radius_m:
            self._publish(self._planning.hold(start, then), then)
            self._publish_status("arrived", [])
            return
        others = self._neighbours.in_odom(self._frame)
        sight = Observations(
            self._sight.clearance(pose.position),
            self._sight.surface(float(self._height.value)),
            half_planes(start.position, start.velocity, others, self._separation, now),
        )
        path = self._planning.plan(start, lookahead_point, sight, then)
        self._plans += 1
        self._publish(path, self._planning.began_ns)
        self._publish_status(str(self._planning.doing), self._warnings())

    def _lookahead_here(self) -> PathLookahead | None:
        """Returns the path in the odometry frame; recomputes it if that frame has moved."""
        if self._path_map is None:
            return None
        at = self._frame.map_from_odom
        if self._lookahead is None or at is not self._frame_was:
            passed = 0.0 if self._lookahead is None else self._lookahead.passed_m
            self._lookahead = PathLookahead(self._frame.to_odom(self._path_map), passed)
            self._frame_was = at
        return self._lookahead

    def _warnings(self) -> list[str]:
        """Returns what makes the flight slower or less certain, as text."""
        is_disturbed = self._tracking.margin_m > _DISTURBED_M
        return self._sight.warnings() + ([PUSHED] if is_disturbed else [])

    def _policy(self) -> PlannerSettings:
        margin = self._tracking.margin_m
        speed = float(self._speed.value) * max(_MIN_SPEED, 1.0 - margin / _STOPPING_M)
        radius = max(self._radius, min(self._radius + margin, _MAX_RADIUS_M))
        return PlannerSettings(
            MotionLimits(speed, self._acceleration, 1.5, 1.5, 1.4),
            radius_m=radius,
            soft_m=PlannerSettings.soft_m + radius - self._radius,
            avoid_unknown=self._avoid_unknown,
        )

    # ---------------------------------------------------------------------------------- publishers

    def _publish(self, path: PrimitivePath, begins_ns: int) -> None:
        frame = self._frame.odom_frame
        self._trajectory.publish(trajectory_message(path, self._planning.yaw, frame, begins_ns))

    def _publish_status(self, state: str, problems: list[str]) -> None:
        lookahead, pose = self._lookahead, self._sight.motion.newest
        left = (
            None if lookahead is None or pose is None else round(lookahead.left_m(pose.position), 1)
        )
        clearance = self._planning.min_clearance_m if state == PlannerState.FLYING else None
        status = {"state": state, "problems": problems, "left_m": left, "plans": self._plans}
        status["off_m"] = round(self._tracking.largest_m, 2)
        if clearance is not None:
            status["clearance_m"] = round(clearance, 2)
        now = self.get_clock().now_ns()
        news = f"{state} {problems}"
        if (
            news != self._last_status
            or not 0 <= now - self._last_status_ns < _STATUS_PERIOD_S * NS_PER_S
        ):
            self._last_status, self._last_status_ns = news, now
            self._status.publish(String(json.dumps(status)))
