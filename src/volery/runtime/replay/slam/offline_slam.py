"""Runs the SLAM node over a log and collects its outputs and the scans of the map."""

from __future__ import annotations

import json
import math
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from volery.autonomy.perception.static_transforms import Mount, StaticTransforms
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import RecordingError
from volery.graph.messages import LaserScan, frame_of, stamp_of
from volery.runtime.replay.slam.extrinsics import frames_of, read_joints
from volery.runtime.replay.slam.initial_pose import beginning_of
from volery.runtime.replay.slam.log_host import LogHost
from volery.runtime.replay.slam.sources import LogSource, TextSource
from volery.runtime.replay.slam.topic_selection import (
    LEVEL,
    NODDING,
    RequestedTopics,
    TopicSelection,
    choose,
)
from volery.runtime.replay.slam.trajectory import EstimatedTrajectory, corrected, path_length_m
from volery.runtime.warmup.parallel_compilation import compile_all

_JOINT = "laser_nodding"
_APART_M, _APART_RAD = 0.25, 0.2
"""Min motion between scans that are drawn into the map, m and rad."""
_NODDING_NS = 175_000_000
"""Time between nodding scans that measure the ground, ns; 1 s is no multiple of it."""
_PROGRESS_S = 0.5
_TIMEOUT_S = 60.0
"""Max simulated time to wait for the final path, s; the first path is that of the log's end."""


@dataclass(frozen=True)
class SlamOptions:
    """Options of a run besides the log."""

    requested_topics: RequestedTopics = field(default_factory=RequestedTopics)
    start: tuple[float, float, float, float] | None = None
    """x, y, z in m and yaw in rad; None: from the log if Volery recorded it, else the origin."""
    level_mount: tuple[float, float, float] | None = None
    nodding_mount: tuple[float, float, float] | None = None
    max_range_m: float = 30.0
    loop_closures: bool = True


@dataclass
class SlamResult:
    """Holds the outcome of a run."""

    channels: TopicSelection
    trajectory: EstimatedTrajectory
    scans: list[tuple[int, LaserScan]]
    """Row in the trajectory, and the scan at that time."""
    mount: Callable[[str], Mount]
    """Returns the mount of a LIDAR frame."""
    num_scans: int
    """Number of scans."""
    lasted_s: float
    """Duration of the log, s."""
    cpu_s: float
    """CPU time of the node alone, s."""
    status: dict[str, Any]
    """Last status message."""
    states: dict[str, float] = field(default_factory=dict)
    """Time in each state, s."""
    problems: dict[str, float] = field(default_factory=dict)
    """Time with each problem, s."""
    nodding: list[tuple[int, LaserScan]] = field(default_factory=list)
    """As `scans`, of the nodding LIDAR; empty without one."""
    nods: Array = field(default_factory=lambda: np.zeros((0, 2)))
    """Times, s, rising, and mount angles, rad, positive down (J, 2)."""
    wheels_m: float | None = None
    """Length of the log's odometry over ground, m; None without odometry."""


class OfflineSlam:
    """Feeds the node with a log. Raises `RecordingError` if the log lacks a required input."""

    def __init__(self, source: LogSource | TextSource, options: SlamOptions) -> None:
        self._source, self._options = source, options
        self.channels = choose(source.path, source.topics, options.requested_topics)
        self.start = options.start or beginning_of(source, self.channels.uav, self.channels.scan)
        """Initial pose; None: the map's origin."""
        self._joints = StaticTransforms()
        self._frames: dict[str, str] = {}
        """Frames of the LIDARs that the node uses, horizontal and nodding."""
        self._host = LogHost()
        self._odometry: list[tuple[float, ...]] = []
        self._times: list[int] = []
        self._wheels: list[tuple[float, float]] = []
        """Positions of the log's odometry."""
        self._scans: list[tuple[int, LaserScan]] = []
        self._nodding: list[tuple[int, LaserScan]] = []
        self._next_nodding_ns = 0
        self._nods: list[tuple[float, float]] = []
        self._newest: LaserScan | None = None
        self._drawn: tuple[float, float, float] | None = None
        self._path: Any = None
        self._tilt = np.array([0.0, 0.0, 0.0, 1.0])
        self._status: dict[str, Any] = {}
        self._states: dict[str, float] = defaultdict(float)
        self._problems: dict[str, float] = defaultdict(float)
        self._status_ns = 0

    def run(self, on_progress: Callable[[int, float], None] | None = None) -> SlamResult:
        """Processes the whole log; `on_progress` receives scans and seconds of the log so far."""
        uav, host = self.channels.uav, self._host
        self._start_node()
        host.listen(f"/{uav}/slam/odom", self._on_odometry)
        host.listen(f"/{uav}/slam/status", self._on_status)
        host.listen("/tf", self._on_tf)
        names = {theirs: ours for ours, theirs in self.channels.names.items()}
        num_scans, cpu, first, before, lasted = 0, 0.0, None, 0, 0
        last_report = time.monotonic()
        for topic, time_ns, message in self._source.messages(set(names)):
            ours = names[topic]
            if ours == f"/{uav}/{LEVEL}":
                num_scans, self._newest = num_scans + 1, message
            if topic == "/tf_static":
                self._joints.add(message)
            if ours == f"/{uav}/odom":
                position = message.pose.pose.position
                self._wheels.append((position.x, position.y))
            self._store_nodding(ours, time_ns, message)
            if first is not None:
                lasted += max(time_ns - before, 0)
            first, before = first or time_ns, time_ns
            began = time.thread_time()
            host.publish(ours, time_ns, message)
            cpu += time.thread_time() - began
            if on_progress is not None and time.monotonic() - last_report > _PROGRESS_S:
                last_report = time.monotonic()
                on_progress(num_scans, lasted / NS_PER_S)
        self._end()
        return self._outcome(num_scans, lasted / NS_PER_S, cpu)

    def _store_nodding(self, topic: str, time_ns: int, message: Any) -> None:
        uav = self.channels.uav
        if topic == f"/{uav}/joint_states" and _JOINT in message.name:
            angle = float(message.position[list(message.name).index(_JOINT)])
            self._nods.append((stamp_of(message) / NS_PER_S, angle))
        elif topic == f"/{uav}/{NODDING}" and self._times and time_ns >= self._next_nodding_ns:
            self._next_nodding_ns = time_ns + _NODDING_NS
            self._nodding.append((len(self._times) - 1, message))

    def _start_node(self) -> None:
        o, uav = self._options, self.channels.uav
        parameters: dict[str, Any] = {
            "max_range_m": o.max_range_m,
            "loop_closures": o.loop_closures,
        }
        if self.start is not None:
            parameters["initial_pose"] = list(self.start)
        level = None if o.level_mount is None else list(o.level_mount)
        options = {"context": self._host.context(), "namespace": f"/{uav}"}
        if not self.channels.has_imu:
            from volery.autonomy.slam.planar_node import PlanarSlam

            compile_all(PlanarSlam.warmup_tasks())
            if level is not None:
                parameters["mount"] = [*level, 0.0, 0.0, 0.0]
            PlanarSlam(**options, parameter_overrides=parameters)
            return
        from volery.autonomy.slam.slam_node import Slam

        compile_all(Slam.warmup_tasks())
        self._find_mounts()
        for name, frame in self._frames.items():
            parameters[f"{name}_mount"] = [float(v) for v in self._mount(frame).position]
        Slam(**options, parameter_overrides=parameters)

    def _find_mounts(self) -> None:
        """Finds the LIDARs' mounts, which the node needs at its start."""
        o, names, uav = self._options, self.channels.names, self.channels.uav
        topics = {"level": f"/{uav}/{LEVEL}", "nodding": f"/{uav}/{NODDING}"}
        self._frames = frames_of(
            self._source, {name: names[topic] for name, topic in topics.items() if topic in names}
        )
        mounts = {"level": o.level_mount, "nodding": o.nodding_mount}
        required = {frame for name, frame in self._frames.items() if mounts[name] is None}
        self._joints, unknown = read_joints(self._source, set(self._frames.values()))
        for name, frame in self._frames.items():
            if frame in unknown & required:
                raise RecordingError(
                    f"{self._source.path}: the log has no transform from {frame} to the body "
                    f"(/tf_static, /tf, /volery/scenario): give --{name}-mount X,Y,Z"
                )

    # ------------------------------------------------------------------------------ subscriptions

    def _on_odometry(self, message: Any) -> None:
        p, q = message.pose.pose.position, message.pose.pose.orientation
        self._times.append(stamp_of(message))
        self._odometry.append((p.x, p.y, p.z, q.x, q.y, q.z, q.w))
        scan = self._newest
        if scan is None:
            return
        yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
        last = self._drawn
        if last is not None:
            turn = abs(math.remainder(yaw - last[2], math.tau))
            if math.hypot(p.x - last[0], p.y - last[1]) < _APART_M and turn < _APART_RAD:
                return
        self._drawn, self._newest = (p.x, p.y, yaw), None
        self._scans.append((len(self._times) - 1, scan))

    def _on_status(self, message: Any) -> None:
        self._count_time()
        self._status = json.loads(message.data)

    def _count_time(self) -> None:
        """Adds the time since the last status to that status's state and problems."""
        now = self._host.now_ns()
        if self._status and now > self._status_ns:
            seconds = (now - self._status_ns) / NS_PER_S
            self._states[self._status["state"]] += seconds
            for problem in self._status["problems"]:
                self._problems[problem] += seconds
        self._status_ns = now

    def _on_tf(self, message: Any) -> None:
        for found in message.transforms:
            if frame_of(found) == "map":
                q = found.transform.rotation
                self._tilt = np.array([q.x, q.y, q.z, q.w])

    def _end(self) -> None:
        """Waits for the final path."""
        paths: list[Any] = []
        self._count_time()
        status, self._status = self._status, {}
        self._host.listen(f"/{self.channels.uav}/slam/path", paths.append)
        self._host.wait(_TIMEOUT_S, lambda: len(paths) > 1)
        self._path = paths[-1] if paths else None
        self._status = {**status, **self._last_counts()}

    def _last_counts(self) -> dict[str, Any]:
        """Returns the counts that changed after the log's end."""
        return {k: v for k, v in self._status.items() if k in ("closures", "keyframes")}

    def _outcome(self, num_scans: int, lasted_s: float, cpu_s: float) -> SlamResult:
        if not self._times:
            reason = ", ".join(self._status.get("problems", ())) or "no scan was usable"
            raise RecordingError(f"{self._source.path}: the SLAM did not start ({reason})")
        poses = [] if self._path is None else self._path.poses
        keyframe_ns = np.array([stamp_of(stamped) for stamped in poses], np.int64)
        keyframes = np.array([_four(stamped.pose) for stamped in poses]).reshape(-1, 4)
        odometry = np.array(self._odometry)
        trajectory = corrected(
            np.array(self._times, np.int64), odometry[:, :3], odometry[:, 3:], keyframe_ns,
            keyframes, self._tilt,
        )  # fmt: skip
        return SlamResult(
            self.channels, trajectory, self._scans, self._mount, num_scans, lasted_s, cpu_s,
            self._status, self._states, self._problems, self._nodding,
            np.array(sorted(self._nods)).reshape(-1, 2),
            path_length_m(np.array(self._wheels)) if self._wheels else None,
        )  # fmt: skip

    def _mount(self, frame: str) -> Mount:
        o, found = self._options, self._joints.mount_of(frame)
        position = o.nodding_mount if frame == self._frames.get("nodding") else o.level_mount
        return found if position is None else Mount(np.array(position), found.attitude)


def _four(pose: Any) -> tuple[float, float, float, float]:
    p, q = pose.position, pose.orientation
    return p.x, p.y, p.z, 2.0 * math.atan2(q.z, q.w)
