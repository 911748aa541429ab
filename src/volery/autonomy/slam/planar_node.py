"""Estimates the pose of a ground vehicle or hand-held scanner: one level LIDAR, no IMU."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from volery.autonomy.perception.list_parameters import declare_numbers
from volery.autonomy.perception.scan_rays import is_usable
from volery.autonomy.perception.static_transforms import LEVEL, Mount, StaticTransforms
from volery.autonomy.slam import messages
from volery.autonomy.slam.planar.health import PlanarHealth, judged
from volery.autonomy.slam.planar.keyframe_graph import PlanarKeyframeGraph
from volery.autonomy.slam.planar.odometry import WheelOdometry, step_between
from volery.autonomy.slam.planar.scans import returns
from volery.autonomy.slam.planar.settings import PlanarSettings, ReturnSettings
from volery.autonomy.slam.planar.tracker import PlanarTracker
from volery.autonomy.status import publish_status
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import (
    LaserScan,
    Odometry,
    PathMessage,
    String,
    TFMessage,
    frame_of,
    stamp_of,
)
from volery.graph.nodes.node import Node

_JUMP_NS = NS_PER_S // 2
"""Step back in stamps from which the clock has been set back."""
_WAITING = 4
"""Max number of scans that wait for the odometry of their time."""
_PATH_NS = 2_000_000
"""Time between two paths, for each keyframe in them."""


class PlanarSlam(SavedAttributes, Node):
    """Publishes `slam/odom`, `slam/pose`, `slam/path` (latched), `slam/status`, and `/tf`.

    Parameters
    ----------
    initial_pose: [x, y, z, yaw] in the map, m and rad; empty: the map begins there.
    mount: [x, y, z, roll, pitch, yaw] of the LIDAR in the body, m and rad; empty: as in
        `/tf_static`, else at the body's origin.
    use_odometry: whether to subscribe to `odom`.
    max_range_m: max range of returns.
    min_range_m: min range of returns.
    loop_closures: whether loop closures correct the map (needs gtsam).

    """

    PARTS = ("_follower", "_keyframe_graph", "_odometry")
    STATE = (
        "_taken_ns",
        "_before",
        "_refused",
        "_resets",
        "_last_status",
        "_received_ns",
        "_path_ns",
        "_path_of",
        "_waiting",
        "_joints",
    )

    WARMUP_TASKS = (
        "volery.autonomy.slam.planar.warmup:walls",
        "volery.autonomy.slam.planar.warmup:place_recognition",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("slam", **options)
        start = declare_numbers(self, "initial_pose", [], "[x, y, z, yaw]", or_empty=True)
        mount = declare_numbers(self, "mount", [], "[x, y, z, roll, pitch, yaw]", or_empty=True)
        self._start = np.array(start or [0.0] * 4)
        self._mount = LEVEL
        self._has_mount_parameter = len(mount) == 6
        if self._has_mount_parameter:
            turn = rotations.from_rpy(*mount[3:])
            self._mount = Mount(np.array(mount[:3]), turn)
        kept = ReturnSettings(
            nearest_m=float(self.declare_parameter("min_range_m", 0.05, min_value=0.0).value),
            max_range_m=float(self.declare_parameter("max_range_m", 30.0, min_value=0.1).value),
        )
        self._settings = PlanarSettings(returns=kept)
        self._uses_odometry = bool(self.declare_parameter("use_odometry", True).value)
        self._has_loops = bool(self.declare_parameter("loop_closures", True).value)
        self._uav = self.get_namespace().strip("/") or "uav"
        self._begin()
        self._open()

    def _begin(self) -> None:
        self._follower = PlanarTracker(self._settings)
        first = self._start[[0, 1, 3]]
        self._keyframe_graph = PlanarKeyframeGraph(self._settings, first, has_loops=self._has_loops)
        self._odometry = WheelOdometry()
        self._before: Array | None = None
        """Pose of the odometry at the newest scan."""
        self._waiting: list[LaserScan] = []
        self._taken_ns: int | None = None
        self._received_ns = self.get_clock().now_ns()
        self._refused = self._resets = 0
        self._last_status = ""
        self._path_ns = self._path_of = self._period_ns = 0
        self._joints = StaticTransforms()

    def _open(self) -> None:
        self._odom = self.create_publisher(Odometry, "slam/odom", 5)
        self._pose = self.create_publisher(messages.POSE, "slam/pose", 5)
        self._path = self.create_publisher(PathMessage, "slam/path", 1, latched=True)
        self._status = self.create_publisher(String, "slam/status", 1, latched=True)
        self._tf = self.create_publisher(TFMessage, "/tf", 10)
        if self._uses_odometry:
            self.create_subscription(Odometry, "odom", self._on_odometry, 50)
        if not self._has_mount_parameter:
            self.create_subscription(TFMessage, "/tf_static", self._on_joints, 10)
        self.create_subscription(LaserScan, "laser/horizontal/scan", self._on_scan, 10)
        self.create_timer(0.5, self._publish_status)

    # ------------------------------------------------------------------------------ subscriptions

    def _on_joints(self, message: TFMessage) -> None:
        self._joints.add(message)

    def _on_odometry(self, message: Odometry) -> None:
        self._odometry.add(message)
        self._take_waiting()

    def _on_scan(self, scan: LaserScan) -> None:
        self._received_ns = self.get_clock().now_ns()
        time_ns, newest = stamp_of(scan), self._taken_ns
        if self._waiting:
            newest = stamp_of(self._waiting[-1])
        if newest is not None and time_ns < newest - _JUMP_NS:
            self._set_clock(time_ns)
            newest = None
        if not is_usable(scan) or (newest is not None and time_ns <= newest):
            self._refused += 1
            return
        self._waiting.append(scan)
        self._take_waiting()

    def _set_clock(self, time_ns: int) -> None:
        while self._waiting:
            self._take(self._waiting.pop(0))
        self._resets += 1
        self._taken_ns = None
        self._before = None
        self._follower.set_clock(time_ns)

    def _take_waiting(self) -> None:
        """Processes scans as soon as the odometry of their time has arrived, or is late."""
        while self._waiting:
            newest, time_ns = self._odometry.newest_ns, stamp_of(self._waiting[0])
            awaited = newest is not None and time_ns - NS_PER_S <= newest < time_ns
            if awaited and len(self._waiting) < _WAITING:
                return
            self._take(self._waiting.pop(0))

    def _take(self, scan: LaserScan) -> None:
        time_ns, follower = stamp_of(scan), self._follower
        here = self._odometry.at(time_ns)
        passed = 0 if self._taken_ns is None else time_ns - self._taken_ns
        self._period_ns += (min(passed, 10 * NS_PER_S) - self._period_ns) // 8
        dt = passed / NS_PER_S
        step = step_between(self._before, here, dt)
        self._before, self._taken_ns = here, time_ns
        mount = self._joints.mount_of(frame_of(scan), self._mount)
        seen = returns(scan, mount, follower.motion.velocity, self._settings.returns)
        frame = follower.follow(time_ns, seen, step)
        if frame is not None:
            self._keyframe_graph.add(frame)
        if follower.is_lost:
            follower.restart()
        if self._keyframe_graph.frames:
            self._publish_map_from_odom(time_ns)

    # ---------------------------------------------------------------------------------- publishers

    def _publish_map_from_odom(self, time_ns: int) -> None:
        motion = self._follower.motion
        pose, velocity = motion.pose, motion.velocity
        state = (
            np.array([pose[0], pose[1], 0.0]),
            rotations.from_yaw(float(pose[2])),
            rotations.rotate(rotations.from_yaw(float(pose[2])), [velocity[0], velocity[1], 0.0]),
            np.array([0.0, 0.0, velocity[2]]),
        )
        covariance = np.zeros((9, 9))
        rows = [0, 1, 8, 3, 4]
        covariance[np.ix_(rows, rows)] = motion.covariance[:5, :5]
        self._odom.publish(messages.odometry(time_ns, self._uav, state, covariance))
        x, y, yaw = self._keyframe_graph.pose(pose)
        z = float(self._start[2])
        spread = self._keyframe_graph.covariance + motion.covariance[:3, :3]
        known = np.sqrt(np.maximum(np.diag(spread), 0.0))
        sigmas = np.array([known[0], known[1], 0.0, 0.0, 0.0, known[2]])
        turn = rotations.from_yaw(float(yaw))
        self._pose.publish(messages.pose_in_map(time_ns, np.array([x, y, z]), turn, sigmas))
        at = self._keyframe_graph.correction
        turn = rotations.from_yaw(float(at[2]))
        position = np.array([at[0], at[1], z])
        self._tf.publish(messages.map_from_odom(time_ns, self._uav, position, turn))

    def _publish_status(self) -> None:
        follower, graph = self._follower, self._keyframe_graph
        state, problems = judged(
            PlanarHealth(
                self.get_clock().now_ns(), self._received_ns, self._period_ns,
                self._odometry_received_ns(), bool(graph.frames), follower.misfits,
                follower.is_blind, follower.is_open, graph.is_placed,
            )
        )  # fmt: skip
        sigma = math.sqrt(max(float(graph.covariance[0, 0]), float(graph.covariance[1, 1])))
        status = {
            "state": state,
            "problems": problems,
            "share": round(follower.fraction, 2),
            "sigma_m": round(sigma, 3),
            "keyframes": len(graph.frames),
            "closures": graph.closures,
            "sessions": graph.session + 1,
            "refused": self._refused + self._odometry.refused,
            "clock_set": self._resets,
        }
        self._last_status = publish_status(self._status, status, self._last_status)
        self._publish_path()

    def _publish_path(self) -> None:
        """Publishes changed keyframes; the longer the path, the less often."""
        graph, now = self._keyframe_graph, self.get_clock().now_ns()
        is_due = now < self._path_ns or now - self._path_ns >= len(graph.frames) * _PATH_NS
        if graph.changes == self._path_of or not is_due:
            return
        graph.finish()
        self._path_ns, self._path_of = now, graph.changes
        z = float(self._start[2])
        poses = [np.array([x, y, z, yaw]) for x, y, yaw in graph.poses]
        times = [frame.time_ns for frame in graph.frames]
        self._path.publish(messages.path(self._taken_ns or times[-1], times, poses))

    def _odometry_received_ns(self) -> int | None:
        """Returns the time of the last odometry, by the node's clock as far as stamps follow it."""
        newest = self._odometry.newest_ns
        if newest is None or self._taken_ns is None:
            return None
        return self.get_clock().now_ns() - max(self._taken_ns - newest, 0)
