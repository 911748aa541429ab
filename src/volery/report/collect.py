"""Collects the data of a report from a running simulation, in bounded memory.

Tracks come from the ground-truth odometry, at most 20 samples a second each. A few LIDAR scans a
second become map points, every beam from the pose at its time (ground truth and mount), thinned to
one point a voxel.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.figures.flight_data import (
    FlightData,
    Ground,
    LidarMap,
    UavTrack,
    drawn_event,
)
from volery.figures.structures import seen_from_above
from volery.figures.trees import trees_of
from volery.graph.messages import stamp_of
from volery.report.scan_placing import end_ns, scan_points
from volery.report.voxels import VoxelSet

if TYPE_CHECKING:
    from volery.graph.messages import Published
    from volery.graph.topics import Subscription
    from volery.runtime.simulation import Simulation

TRACK_PERIOD_NS = NS_PER_S // 20
SCANS_PER_S = 24.0
"""Scans of the whole fleet that are mapped per simulated second."""
CLOUDS_PER_S = 4.0
"""Clouds of the whole fleet that are mapped per simulated second; each is worth many scans."""
NODDING_WEIGHT = 4.0
"""Weight of a nodding scanner, which observes the third dimension, against a level one."""
VOXEL_M = 0.25
MAX_CLEARANCE_M = 10.0
_POSES_KEPT = 64
_CLEARANCE_BATCH = 4096


@dataclass
class _Uav:
    """Data of one UAV."""

    poses: deque[tuple[int, Any]] = field(default_factory=lambda: deque(maxlen=_POSES_KEPT))
    times_ns: list[int] = field(default_factory=list)
    rows: list[tuple[float, ...]] = field(default_factory=list)
    next_row_ns: int = 0
    waiting: list[tuple[Any, Any]] = field(default_factory=list)
    """Scans, with their mounts, whose last beam is younger than the newest pose."""


class FlightCollector:
    """Subscribes to a simulation; `finish` returns the flight as data.

    The collector reads the simulation's graph, mounts, terrain, forest, scene, events and times.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._voxels = VoxelSet(VOXEL_M)
        self._scans = 0
        self._uavs = {name: _Uav() for name in simulation.uavs}
        self._subscriptions: list[Subscription] = []
        for name, uav in self._uavs.items():
            self._subscribe(f"/{name}/ground_truth/odom", self._track(uav), "nav_msgs/msg/Odometry")
        mounts: Mapping[str, Any] = simulation.vehicles.lidar_mounts
        clouds: Mapping[str, Any] = simulation.vehicles.point_cloud_mounts
        weights = {t: NODDING_WEIGHT if m.nods else 1.0 for t, m in mounts.items()}
        for topic, mount in mounts.items():
            uav = self._uavs[topic.split("/")[1]]
            rate_hz = SCANS_PER_S * weights[topic] / sum(weights.values())
            receive = self._scan(uav, mount, round(NS_PER_S / rate_hz))
            self._subscribe(topic, receive, "sensor_msgs/msg/LaserScan")
        for topic, mount in clouds.items():
            uav = self._uavs[topic.split("/")[1]]
            receive = self._scan(uav, mount, round(NS_PER_S * len(clouds) / CLOUDS_PER_S))
            self._subscribe(topic, receive, "sensor_msgs/msg/PointCloud2")

    def _subscribe(self, topic: str, receive: Callable[[Published], None], msgtype: str) -> None:
        self._subscriptions.append(self._simulation.graph.subscribe(topic, receive, msgtype))

    def _track(self, uav: _Uav) -> Callable[[Published], None]:
        def receive(published: Published) -> None:
            message = published.message
            stamp = stamp_of(message)
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
        ready = [pair for pair in uav.waiting if end_ns(pair[0]) <= newest_ns]
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
        """Returns everything up to now and stops; call it before the simulation is closed."""
        for subscription in self._subscriptions:
            subscription.cancel()
        simulation = self._simulation
        scenario = simulation.scenario
        grid = simulation.world.terrain.grid
        return FlightData(
            scenario=scenario.name,
            description=scenario.description,
            seed=scenario.seed,
            simulated_s=simulation.time_ns / NS_PER_S,
            planned_s=scenario.duration_s,
            wall_s=wall_s,
            uavs=tuple(self._finished(name, uav) for name, uav in self._uavs.items()),
            ground=Ground(np.asarray(grid.heights), (grid.origin_x, grid.origin_y), grid.spacing),
            trees=trees_of(simulation.world.forest),
            structures=seen_from_above(solid.mesh for solid in simulation.world.scene.solids),
            lidar=self._lidar_map(),
            events=tuple(drawn_event(event) for event in simulation.diagnostics.events),
            stage_seconds=dict(simulation.diagnostics.stage_seconds),
            max_clearance_m=MAX_CLEARANCE_M,
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
            - self._simulation.world.terrain.height(position[:, 0], position[:, 1]),
            clearance_m=self._clearance(position),
        )

    def _ground(self, points: NDArray[np.floating]) -> Array:
        """Returns the height of the ground below points (n, 3)."""
        x, y = points[:, 0].astype(np.float64), points[:, 1].astype(np.float64)
        return np.asarray(self._simulation.world.terrain.height(x, y), dtype=np.float64)

    def _clearance(self, points: Array) -> Array:
        found = np.full(len(points), np.inf)
        for start in range(0, len(points), _CLEARANCE_BATCH):
            part = slice(start, start + _CLEARANCE_BATCH)
            result = self._simulation.world.scene.clearance(
                points[part], MAX_CLEARANCE_M, include_terrain=False
            )
            found[part] = result.distance
        found[found >= MAX_CLEARANCE_M] = np.inf
        return found

    def _lidar_map(self) -> LidarMap | None:
        points = self._voxels.centers()
        if not len(points):
            return None
        height = points[:, 2] - self._ground(points)
        return LidarMap(points, height.astype(np.float32), self._voxels.voxel_m, self._scans)
