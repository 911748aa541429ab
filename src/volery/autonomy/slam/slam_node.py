"""Estimates pose and velocity of the vehicle from IMU, LIDARs and sonar alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.autonomy.perception.list_parameters import declare_mount, declare_numbers
from volery.autonomy.perception.motion_history import NodHistory
from volery.autonomy.perception.scan_rays import has_return, is_usable, scan_times
from volery.autonomy.slam import messages
from volery.autonomy.slam.health import SlamHealth
from volery.autonomy.slam.inertial_kernels import BG, G, Q, V
from volery.autonomy.slam.keyframe_graph import KeyframeGraph
from volery.autonomy.slam.keyframes import levelling
from volery.autonomy.slam.settings import ImuNoise, ScanMatching
from volery.autonomy.slam.sweep import Sweep
from volery.autonomy.slam.tracker import Tracker
from volery.autonomy.status import publish_status
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import (
    Imu,
    JointState,
    LaserScan,
    Odometry,
    PathMessage,
    Range,
    String,
    TFMessage,
    stamp_of,
)
from volery.graph.nodes.node import Node


class LevelOdometry(SavedAttributes):
    """Integrates the tracker's motion; each step is levelled by the current estimate of gravity.

    So the odometry neither jumps nor tilts as the estimate improves: users combine it with an IMU
    and assume that gravity points straight down.
    """

    STATE = ("_was", "position")

    def __init__(self) -> None:
        self._was: Array | None = None
        self.position = np.zeros(3)
        """(3,) m, position of the vehicle in the level frame."""

    def follow(self, state: Array) -> tuple[Array, Array]:
        """Returns position (3,) and attitude (4,) in the level frame, for a tracker state (19,)."""
        turn = levelling(state[G : G + 3])
        if self._was is None:
            self.position = state[:3].copy()
        else:
            self.position = self.position + rotations.rotate(turn, state[:3] - self._was)
        self._was = state[:3].copy()
        return self.position, rotations.multiply(turn, state[Q : Q + 4])


_JUMP_NS = NS_PER_S // 2
"""Step back in stamps from which the clock has been set back."""
_LONGEST_GAP_NS = 2 * NS_PER_S
"""Max gap in the IMU data; after a longer one the position is unknown."""
_UNKNOWN, _DOUBTED = (3.0, 0.3), (0.5, 0.0)
"""Standard deviations of velocity (m/s) and attitude (rad) after such a gap, and after scans did
not match the map.
"""
_NOTICED_NS, _SEEN_NS = round(1.5 * NS_PER_S), NS_PER_S // 2
"""Time in which a displacement is detected by the map, and by the returns just before."""
_QUEUE = 500
"""Queue of samples while the node's process is busy: two seconds at 200 Hz."""
_NOISE = "[gyro, its walk, its bias, accelerometer, its walk, its bias]"
_MAX_RAD_S, _MAX_M_S2 = 60.0, 500.0
"""Beyond the range of any IMU."""


class Slam(SavedAttributes, Node):
    """Publishes `slam/odom`, `slam/pose`, `slam/path` (latched), `slam/status`, and `/tf`.

    Parameters
    ----------
    initial_pose: [x, y, z, yaw] in the map, m and rad; empty: the map begins there.
    level_mount, nodding_mount: [x, y, z] of the LIDARs in the body, m.
    imu_noise: densities of gyroscope and accelerometer, of their biases' random walks, and
        turn-on biases, in SI units; empty: the ADIS16448's.
    landed_height_m: height of the body over the ground when landed.
    odom_rate_hz, pose_rate_hz: rates at which they are published.
    scan_rate_hz: sweeps processed per second and LIDAR.
    max_range_m: max range of returns.
    loop_closures: whether loop closures correct the map (needs gtsam).

    """

    PARTS = ("_tracker", "_level", "_keyframe_graph", "_health")
    STATE = (
        "_nod",
        "_omega",
        "_last_status",
        "_taken_ns",
        "_odom_ns",
        "_refused",
        "_resets",
        "_shown",
    )

    WARMUP_TASKS = (
        "volery.autonomy.slam.warmup:motion",
        "volery.autonomy.slam.warmup:loop_closure",
        "volery.autonomy.slam.warmup:lost_motion",
        "volery.autonomy.slam.warmup:sight",
        "volery.autonomy.perception.warmup:scan_returns",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("slam", **options)
        start = declare_numbers(self, "initial_pose", [], "[x, y, z, yaw]", or_empty=True)
        noise = declare_numbers(self, "imu_noise", [], _NOISE, or_empty=True)
        self._start = np.array(start or [0.0] * 4)
        self._mounts = {name: np.array(declare_mount(self, name)) for name in ("level", "nodding")}
        self._imu_noise = ImuNoise(*noise) if noise else ImuNoise()
        self._matching = ScanMatching(
            max_range_m=float(self.declare_parameter("max_range_m", 30.0, min_value=0.1).value)
        )
        self._landed_height_m = float(
            self.declare_parameter("landed_height_m", 0.2, min_value=0.0).value
        )
        self._has_loops = bool(self.declare_parameter("loop_closures", True).value)
        period = NS_PER_S / float(
            self.declare_parameter("scan_rate_hz", 20.0, min_value=0.1, max_value=1000.0).value
        )
        self._sweep_ns = round(0.9 * period)  # tolerates a scan that arrives slightly early
        self._odom_period_ns = round(
            NS_PER_S
            / self.declare_parameter("odom_rate_hz", 50.0, min_value=0.1, max_value=1000.0).value
        )
        self._uav = self.get_namespace().strip("/") or "uav"
        self._begin()
        self._open(
            1.0
            / float(
                self.declare_parameter("pose_rate_hz", 10.0, min_value=0.1, max_value=1000.0).value
            )
        )

    def _begin(self) -> None:
        self._tracker = Tracker(self._start, self._imu_noise, self._matching)
        self._tracker.landed_height_m = self._landed_height_m
        self._level = LevelOdometry()
        self._keyframe_graph = KeyframeGraph(self._matching, self._start, self._has_loops)
        self._health = SlamHealth(
            ("IMU", "level LIDAR", "nodding LIDAR"), self.get_clock().now_ns()
        )
        self._nod = NodHistory()
        self._omega = np.zeros(3)
        self._taken_ns: dict[str, int] = {}
        self._odom_ns = 0
        self._refused = self._resets = 0
        self._last_status = ""
        self._shown = (0, 0)
        """Numbers of keyframes and closures of the last published path."""

    def _open(self, pose_period_s: float) -> None:
        self._odom = self.create_publisher(Odometry, "slam/odom", 5)
        self._pose = self.create_publisher(messages.POSE, "slam/pose", 5)
        self._path = self.create_publisher(PathMessage, "slam/path", 1, latched=True)
        self._status = self.create_publisher(String, "slam/status", 1, latched=True)
        self._tf = self.create_publisher(TFMessage, "/tf", 10)
        self.create_subscription(Imu, "imu", self._on_imu, _QUEUE)
        self.create_subscription(JointState, "joint_states", self._on_joint, _QUEUE)
        self.create_subscription(Range, "range", self._on_range, 5)
        self.create_subscription(
            LaserScan, "laser/horizontal/scan", lambda m: self._on_scan("level", m), 5
        )
        self.create_subscription(
            LaserScan, "laser/nodding/scan", lambda m: self._on_scan("nodding", m), 5
        )
        self.create_timer(pose_period_s, self._publish_pose)
        self.create_timer(0.5, self._publish_status)

    # ------------------------------------------------------------------------------ subscriptions

    def _on_imu(self, message: Imu) -> None:
        w, a = message.angular_velocity, message.linear_acceleration
        time_ns, newest = stamp_of(message), self._tracker.time_ns
        if not (abs(w.x) + abs(w.y) + abs(w.z) < _MAX_RAD_S and
                abs(a.x) + abs(a.y) + abs(a.z) < _MAX_M_S2):  # fmt: skip  # leaves out nan
            self._refused += 1
            return
        if newest and (time_ns < newest - _JUMP_NS or time_ns > newest + _LONGEST_GAP_NS):
            self._set_clock(time_ns)
        self._health.received_ns["IMU"] = self.get_clock().now_ns()
        gyro = np.array([w.x, w.y, w.z])
        seen = self._tracker.add_imu(time_ns, gyro, np.array([a.x, a.y, a.z]))
        for returns in seen:
            self._keyframe_graph.add(returns, self._tracker)
        if self._tracker.sight.is_broken:
            self._publish_status()  # each further sweep would increase the error
        self._omega = gyro - self._tracker.state[BG : BG + 3]
        if self._tracker.is_ready and time_ns - self._odom_ns >= self._odom_period_ns:
            self._odom_ns = time_ns
            self._publish_odometry(time_ns)

    def _set_clock(self, time_ns: int) -> None:
        """Resets after a clock jump or an IMU timeout: continues with unknown motion."""
        self._nod = NodHistory()
        self._taken_ns = {}
        self._odom_ns = 0
        self._resets += 1
        self._tracker.set_clock(time_ns)
        if self._tracker.is_ready:
            self._lose(*_UNKNOWN)

    def _on_joint(self, message: JointState) -> None:
        self._nod.add_message(message)

    def _on_range(self, message: Range) -> None:
        self._tracker.add_range(stamp_of(message), float(message.range))

    def _on_scan(self, name: str, scan: LaserScan) -> None:
        first, last = scan_times(scan)
        if not is_usable(scan) or first <= self._taken_ns.get(name, -1):
            self._refused += 1
            return
        if has_return(scan):
            self._health.received_ns[f"{name} LIDAR"] = self.get_clock().now_ns()
        if first - self._taken_ns.get(name, -(1 << 60)) < self._sweep_ns:
            return
        nods = (0.0, 0.0) if name == "level" else (self._nod.at(first), self._nod.at(last))
        if nods[0] is None or nods[1] is None:
            self._refused += 1
            return
        self._taken_ns[name] = first
        ranges = np.asarray(scan.ranges, np.float32)
        self._tracker.add_sweep(
            Sweep(
                name, first, float(scan.time_increment) * NS_PER_S, float(scan.angle_min),
                float(scan.angle_increment), ranges, self._mounts[name], nods[0], nods[1],
            )
        )  # fmt: skip

    # ---------------------------------------------------------------------------------- publishers

    def _publish_odometry(self, time_ns: int) -> None:
        t = self._tracker
        position, attitude = self._level.follow(t.state)
        velocity = rotations.rotate(levelling(t.state[G : G + 3]), t.state[V : V + 3])
        parts = (position, attitude, velocity, self._omega)
        self._odom.publish(messages.odometry(time_ns, self._uav, parts, t.covariance[:9, :9]))

    def _publish_pose(self) -> None:
        t = self._tracker
        if (
            not t.is_ready
            or t.is_astray
            or not self._keyframe_graph.frames
            or not self._keyframe_graph.is_placed
        ):
            return
        position, attitude = self._keyframe_graph.pose(t)
        four, tilt = self._keyframe_graph.sigmas(t), np.sqrt(np.diag(t.covariance)[15:17])
        own = np.sqrt(np.diag(t.covariance)[[0, 1, 2, 8]])
        x, y, z, yaw = np.hypot(four, own)
        sigmas = np.array([x, y, z, tilt[0], tilt[1], yaw])
        self._pose.publish(messages.pose_in_map(t.time_ns, position, attitude, sigmas))
        here, own = self._level.follow(t.state)
        turn = rotations.multiply(attitude, rotations.conjugate(own))
        translation = position - rotations.rotate(turn, here)
        self._tf.publish(messages.map_from_odom(t.time_ns, self._uav, translation, turn))

    def _publish_status(self) -> None:
        t, graph, now = self._tracker, self._keyframe_graph, self.get_clock().now_ns()
        noticed_ns = _SEEN_NS if t.sight.is_broken else _NOTICED_NS
        if self._health.look(t, now, graph.is_placed):
            self._lose(*_DOUBTED, t.time_ns - noticed_ns)
        status = {
            "state": self._health.state,
            "problems": self._health.problems,
            "uprights": {name: round(m.met, 1) for name, m in sorted(t.match.items())},
            "sigma_m": round(t.sigma_m, 3),
            "keyframes": len(graph.frames),
            "closures": graph.closures,
            "sessions": graph.session + 1,
            "refused": self._refused + t.refused,
            "clock_set": self._resets,
        }
        self._last_status = publish_status(self._status, status, self._last_status)
        shown = (len(graph.frames), graph.closures)
        if shown != self._shown and graph.frames:
            self._shown = shown
            times = [frame.time_ns for frame in graph.frames]
            self._path.publish(messages.path(t.time_ns, times, graph.poses))

    def _lose(
        self, speed_sigma: float, turn_sigma: float, wrong_since_ns: int | None = None
    ) -> None:
        """Begins new maps, whose pose in the old one must be found by relocalization."""
        moved = self._tracker.sight.moved
        self._tracker.restart(speed_sigma, turn_sigma)
        self._health.restart()
        if self._keyframe_graph.frames:
            self._keyframe_graph.restart(wrong_since_ns, moved)
