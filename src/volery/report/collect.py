"""Listens to a running simulation and keeps, in bounded memory, what its report will show.

Tracks come from the ground-truth odometry, at most 20 samples a second each. Of the LIDAR scans a
few a second are turned into map points, every beam from the pose it had (ground truth and mount),
and thinned to one point a voxel.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.clock import NS_PER_S
from volery.graph.lidar_publishing import cloud_points
from volery.report.flight_data import (
    FlightData,
    FlightEvent,
    Ground,
    LidarMap,
    Trees,
    UavTrack,
)
from volery.report.voxels import VoxelSet

if TYPE_CHECKING:
    from volery.graph.messages import Published

Array = NDArray[np.float64]

TRACK_PERIOD_NS = NS_PER_S // 20
SCANS_PER_S = 24.0
"""Scans of the whole fleet that are mapped in a simulated second."""
NODDING_WEIGHT = 4.0
"""A nodding scanner sees the third dimension: it gets more of the scans than a level one."""
VOXEL_M = 0.25
MAX_RANGE_M = 28.0
"""Beams longer than that are not mapped: heading errors and dropouts spoil them."""
CLEARANCE_REACH_M = 10.0
_POSES_KEPT = 64
_CLEARANCE_BATCH = 4096


@dataclass
class _Uav:
    """What is gathered of one UAV."""

    poses: deque[tuple[int, Any]] = field(default_factory=lambda: deque(maxlen=_POSES_KEPT))
    times_ns: list[int] = field(default_factory=list)
    rows: list[tuple[float, ...]] = field(default_factory=list)
    next_row_ns: int = 0
    waiting: list[tuple[Any, Any]] = field(default_factory=list)
    """Scans, with their mounts, whose last beam is younger than the newest pose."""


class FlightCollector:
    """Subscribes to a simulation; `finish` gives the flight as data.

    `simulation` is a `volery.Simulation`: its graph, mounts, terrain, forest, scene, events and
    times are read.
    """

    def __init__(self, simulation: Any) -> None:
        self._simulation = simulation
        self._voxels = VoxelSet(VOXEL_M)
        self._scans = 0
        self._uavs = {name: _Uav() for name in simulation.uav_names}
        graph = simulation.graph
        for name, uav in self._uavs.items():
            graph.subscribe(f"/{name}/ground_truth/odom", self._track(uav), "nav_msgs/msg/Odometry")
        mounts: Mapping[str, Any] = simulation.mounts
        clouds: Mapping[str, Any] = simulation.cloud_mounts
        weights = {t: NODDING_WEIGHT if m.nods else 1.0 for t, m in mounts.items()}
        weights |= dict.fromkeys(clouds, 1.0)
        for topic, mount in {**mounts, **clouds}.items():
            uav = self._uavs[topic.split("/")[1]]
            rate_hz = SCANS_PER_S * weights[topic] / sum(weights.values())
            receive = self._scan(uav, mount, round(NS_PER_S / rate_hz))
            kind = "PointCloud2" if topic in clouds else "LaserScan"
            graph.subscribe(topic, receive, f"sensor_msgs/msg/{kind}")

    def _track(self, uav: _Uav) -> Callable[[Published], None]:
        def receive(published: Published) -> None:
            message = published.message
            stamp = _stamp_ns(message)
            uav.poses.append((stamp, message.pose.pose))
            if stamp >= uav.next_row_ns:
                uav.next_row_ns = stamp + TRACK_PERIOD_NS
                p, v = message.pose.pose.position, message.twist.twist.linear
                uav.times_ns.append(stamp)
                uav.rows.append((p.x, p.y, p.z, (v.x**2 + v.y**2 + v.z**2) ** 0.5))
            if uav.waiting:
                self._map_waiting(uav, stamp)

        return receive

    def _scan(self, uav: _Uav, mount: Any, period_ns: int) -> Callable[[Published], None]:
        next_ns = 0

        def receive(published: Published) -> None:
            nonlocal next_ns
            if published.time_ns < next_ns:
                return
            next_ns = published.time_ns + period_ns
            uav.waiting.append((published.message, mount))
            if uav.poses:
                self._map_waiting(uav, uav.poses[-1][0])

        return receive

    def _map_waiting(self, uav: _Uav, newest_ns: int) -> None:
        ready = [pair for pair in uav.waiting if _end_ns(pair[0]) <= newest_ns]
        for pair in ready:
            uav.waiting.remove(pair)
            points = scan_points(*pair, uav.poses)
            if points is not None:
                self._voxels.add(points)
                self._scans += 1

    def finish(
        self,
        wall_s: float,
        *,
        digest: str = "",
        interrupted: str = "",
        log_path: Path | None = None,
        log_messages: int = 0,
        machine: Mapping[str, str] | None = None,
        versions: Mapping[str, str] | None = None,
    ) -> FlightData:
        """Everything up to now; call it before the simulation is closed."""
        simulation = self._simulation
        scenario = simulation.scenario
        grid = simulation.terrain.grid
        return FlightData(
            scenario=scenario.name,
            description=scenario.description,
            seed=scenario.seed,
            simulated_s=simulation.time_ns / NS_PER_S,
            planned_s=scenario.duration_s,
            wall_s=wall_s,
            uavs=tuple(self._finished(name, uav) for name, uav in self._uavs.items()),
            ground=Ground(np.asarray(grid.heights), (grid.origin_x, grid.origin_y), grid.spacing),
            trees=_trees(simulation.forest),
            lidar=self._lidar_map(),
            events=tuple(_event(event) for event in simulation.events),
            stage_seconds=dict(simulation.stage_seconds),
            clearance_reach_m=CLEARANCE_REACH_M,
            digest=digest,
            interrupted=interrupted,
            log_path=log_path,
            log_messages=log_messages,
            machine=machine or {},
            versions=versions or {},
        )

    def _finished(self, name: str, uav: _Uav) -> UavTrack:
        rows = np.array(uav.rows, dtype=np.float64).reshape(-1, 4)
        position = np.ascontiguousarray(rows[:, :3])
        return UavTrack(
            name=name,
            time_s=np.array(uav.times_ns, dtype=np.float64) / NS_PER_S,
            position_map=position,
            speed_m_s=rows[:, 3],
            height_m=position[:, 2]
            - self._simulation.terrain.height(position[:, 0], position[:, 1]),
            clearance_m=self._clearance(position),
        )

    def _ground(self, points: NDArray[np.floating]) -> Array:
        """Height of the ground below points (n, 3)."""
        x, y = points[:, 0].astype(np.float64), points[:, 1].astype(np.float64)
        return np.asarray(self._simulation.terrain.height(x, y), dtype=np.float64)

    def _clearance(self, points: Array) -> Array:
        found = np.full(len(points), np.inf)
        for start in range(0, len(points), _CLEARANCE_BATCH):
            part = slice(start, start + _CLEARANCE_BATCH)
            result = self._simulation.scene.clearance(
                points[part], CLEARANCE_REACH_M, include_terrain=False
            )
            found[part] = result.distance
        found[found >= CLEARANCE_REACH_M] = np.inf
        return found

    def _lidar_map(self) -> LidarMap | None:
        points = self._voxels.centers()
        if not len(points):
            return None
        height = points[:, 2] - self._ground(points)
        return LidarMap(points, height.astype(np.float32), self._voxels.voxel_m, self._scans)


def scan_points(scan: Any, mount: Any, poses: deque[tuple[int, Any]]) -> NDArray[np.float64] | None:
    """Map points (n, 3) of a LaserScan or PointCloud2; None without poses.

    Each beam is placed from the body's poses at the start and at the end of the sweep, which come
    from `poses` (time in ns, geometry_msgs/Pose), and the two places are interpolated.
    """
    start_ns, end_ns = _stamp_ns(scan), _end_ns(scan)
    if not poses or poses[0][0] > start_ns:
        return None
    along, fraction = _beams_of_cloud(scan) if _is_cloud(scan) else _beams_of_scan(scan)
    ends = (_pose_at(poses, start_ns), _pose_at(poses, end_ns))
    nod = _nodding_angles(mount, start_ns, end_ns, fraction)
    if nod is not None:
        # about the sensor's y axis, positive looks down
        x, y, z = along.T
        along = np.stack(
            [x * np.cos(nod) + z * np.sin(nod), y, z * np.cos(nod) - x * np.sin(nod)], -1
        )
    in_body = along @ rotations.matrix(mount.attitude_body).T + np.asarray(mount.position_body)
    # a sweep turns the body by a few hundredths of a radian: points may be interpolated
    first, last = (p + in_body @ rotations.matrix(q).T for p, q in ends)
    return np.asarray(first + fraction[:, None] * (last - first))


def _beams_of_scan(scan: Any) -> tuple[Array, Array]:
    """Returns of a LaserScan in the sensor frame (n, 3) and their share of the sweep's time (n,)."""
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    beams = np.flatnonzero(
        (ranges >= scan.range_min) & (ranges <= min(scan.range_max, MAX_RANGE_M))
    )
    azimuth = scan.angle_min + scan.angle_increment * beams
    reach = ranges[beams]
    along = np.stack([reach * np.cos(azimuth), reach * np.sin(azimuth), np.zeros(len(beams))], -1)
    return along, beams / max(len(ranges) - 1, 1)


def _beams_of_cloud(cloud: Any) -> tuple[Array, Array]:
    """Points of a PointCloud2 in the sensor frame (n, 3) and their share of the sweep's time (n,)."""
    points = cloud_points(cloud)
    along = np.stack([points[name].astype(np.float64) for name in ("x", "y", "z")], -1)
    near = np.linalg.norm(along, axis=1) <= MAX_RANGE_M
    time = points["time"].astype(np.float64)
    return along[near], time[near] / max(time.max(initial=0.0), 1e-9)


def _nodding_angles(mount: Any, start_ns: int, end_ns: int, fraction: Array) -> Array | None:
    if not mount.nods:
        return None
    from volery.sensors.mount import nodding_angle_at

    knots = np.linspace(0.0, 1.0, 5)
    angles = [nodding_angle_at(mount, start_ns + round(k * (end_ns - start_ns))) for k in knots]
    return np.interp(fraction, knots, angles)


def _pose_at(poses: deque[tuple[int, Any]], time_ns: int) -> tuple[Array, Array]:
    """Position (3,) and attitude (4,) at a time between the first pose and the last."""
    later = next((k for k, (t, _) in enumerate(poses) if t >= time_ns), len(poses) - 1)
    before = max(later - 1, 0)
    (t0, a), (t1, b) = poses[before], poses[later]
    p0, q0 = _arrays(a)
    p1, q1 = _arrays(b)
    share = min(max((time_ns - t0) / (t1 - t0), 0.0), 1.0) if t1 > t0 else 1.0
    q1 = q1 if q0 @ q1 >= 0.0 else -q1
    return p0 + share * (p1 - p0), rotations.normalize(q0 + share * (q1 - q0))


def _arrays(pose: Any) -> tuple[Array, Array]:
    p, q = pose.position, pose.orientation
    return np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])


def _stamp_ns(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)


def _end_ns(scan: Any) -> int:
    if _is_cloud(scan):
        sweep_s = float(cloud_points(scan)["time"].max(initial=0.0))
    else:
        sweep_s = float((len(scan.ranges) - 1) * scan.time_increment)
    return _stamp_ns(scan) + round(sweep_s * NS_PER_S)


def _is_cloud(message: Any) -> bool:
    return hasattr(message, "point_step")


def _event(event: Any) -> FlightEvent:
    x, y, z = (float(v) for v in event.position_map)
    kind = str(getattr(event.kind, "value", event.kind))
    return FlightEvent(event.time_ns / NS_PER_S, kind, event.describe(), (x, y, z))


def _trees(forest: Any) -> Trees | None:
    if forest is None or not len(forest.position_map):
        return None
    crowns = np.array([_crown_radius(model) for model in forest.models])
    stretch = np.asarray(forest.scale)[:, :2].mean(axis=1)
    return Trees(
        position_map=np.asarray(forest.position_map, dtype=np.float64),
        crown_radius_m=crowns[np.asarray(forest.model_index)] * stretch,
        dbh_m=np.asarray(forest.dbh_m, dtype=np.float64),
    )


def _crown_radius(model: Any) -> float:
    """Radius that holds nine tenths of the crown's vertices; of the wood where it is bare."""
    level = min(model.levels.values(), key=lambda tree: len(tree.leaves.vertices))
    vertices = level.leaves.vertices if len(level.leaves.vertices) else level.wood.vertices
    if not len(vertices):
        return 0.0
    return float(np.quantile(np.hypot(vertices[:, 0], vertices[:, 1]), 0.9))
