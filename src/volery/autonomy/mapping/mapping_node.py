"""Maps the scans of two LIDARs: voxels for visualization and planning, a grid at flight height."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import Any

from volery.autonomy.mapping import messages
from volery.autonomy.mapping.map_files import MapLimits, node_count, read_map, write_map
from volery.autonomy.mapping.octree import Octree
from volery.autonomy.mapping.projected_grid import HeightSlab, ProjectedGrid
from volery.autonomy.mapping.scan_buffer import ScanBuffer
from volery.autonomy.perception.ground_plane import GroundPlane
from volery.autonomy.perception.list_parameters import declare_mount
from volery.autonomy.perception.map_frame import MAP, UNKNOWN_POSE, MapFrame
from volery.autonomy.perception.motion_history import MotionHistory, NodHistory
from volery.autonomy.perception.odometry_topics import subscribe_odometry
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.perception.scan_rays import Beams, RayMaker, Rays
from volery.autonomy.status import publish_status
from volery.core.clock import NS_PER_S
from volery.core.errors import DataFileError, NodeError
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import (
    JointState,
    LaserScan,
    OccupancyGrid,
    Odometry,
    Range,
    String,
)
from volery.graph.nodes.node import Node

_SONAR_MEMORY_S = 0.5
_SILENT_S = 2.0
"""Time without data, or without returns, after which a sensor is reported."""
_MIN_HEIGHT_M = 1.0
"""Min height above ground for the grid; lower it would show the ground."""
_MAX_FILES = 100
"""Max number of files in a map folder, as clients of the graph name them. Modelling choice."""


class Mapping(SavedAttributes, Node):
    """Publishes `octomap_binary` and `projected_map` (both latched), `~/status`.

    Services: `~/octomap` (octomap_msgs/GetOctomap); `~/save` and `~/load` (ByName: a file's name in
    `folder`).

    Parameters
    ----------
    odometry: topic of the pose; `use_map_tf`: whether `/tf` holds the pose of its frame in the map.
    level_mount, nodding_mount: [x, y, z] of the LIDARs in the body, m.
    resolution_m: cell size of the octree; grid_resolution_m: of the grid.
    max_range_m: max range; beyond it returns count as free space up to it.
    scan_rate_hz: scans processed per second and LIDAR; beam_step: step between processed beams.
    max_nodes: bound of the octree; extent_m: of the grid, and of maps that are loaded.
    half_height_m: half the thickness of the slab that the grid shows.
    voxels_period_s, grid_period_s: periods of publication.
    folder: where maps are saved and loaded, created with the first one; empty: nowhere. Default:
        `maps/uavN` in the working directory.
    map_file: initial map, a file in `folder`.

    """

    PARTS = ("_octree", "_grid", "_frame")
    STATE = ("_motion", "_nod", "_intakes", "_ground", "_range", "_last_status", "_slab_z")

    WARMUP_TASKS = (
        "volery.autonomy.mapping.warmup:growing_map",
        "volery.autonomy.mapping.warmup:read_maps",
        "volery.autonomy.perception.warmup:scan_returns",
        "volery.autonomy.perception.warmup:scan_repeats",
        "volery.autonomy.perception.warmup:scan_rays",
        "volery.autonomy.perception.warmup:ground",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("mapping", **options)
        self._resolution = float(self.declare_parameter("resolution_m", 0.2, min_value=0.01).value)
        self._max_range_m = float(self.declare_parameter("max_range_m", 15.0, min_value=0.1).value)
        beam_step = int(self.declare_parameter("beam_step", 2, min_value=1).value)
        rate = float(
            self.declare_parameter("scan_rate_hz", 5.0, min_value=0.01, max_value=1000.0).value
        )
        extent = float(self.declare_parameter("extent_m", 500.0, min_value=1.0).value)
        nodes = int(self.declare_parameter("max_nodes", 3_000_000, min_value=1).value)
        self._half = float(self.declare_parameter("half_height_m", 0.6, min_value=0.01).value)
        self._folder = self.declare_folder("folder", f"maps{self.get_namespace()}")
        self._limits = MapLimits(self._resolution, extent, nodes)
        beams = Beams(max_range_m=self._max_range_m, every=beam_step)
        self._intakes = {
            name: ScanBuffer(RayMaker(declare_mount(self, name), beams), rate)
            for name in ("level", "nodding")
        }
        self._octree = Octree(self._resolution, nodes)
        self._grid = ProjectedGrid(
            float(self.declare_parameter("grid_resolution_m", 0.4, min_value=0.01).value), extent
        )
        self._frame = MapFrame()
        self._motion, self._nod = MotionHistory(), NodHistory()
        self._ground = GroundPlane()
        self._range: tuple[int, float] | None = None
        self._slab_z = 0.0
        self._last_status = ""
        self._open()
        map_file = str(self.declare_parameter("map_file", "").value)
        if map_file:
            self._load(map_file)

    def _open(self) -> None:
        voxels_s = float(self.declare_parameter("voxels_period_s", 10.0, min_value=0.01).value)
        grid_s = float(self.declare_parameter("grid_period_s", 1.0, min_value=0.01).value)
        self._voxels = self.create_publisher(messages.OCTOMAP, "octomap_binary", 1, latched=True)
        self._level = self.create_publisher(OccupancyGrid, "projected_map", 1, latched=True)
        self._status = self.create_publisher(String, "~/status", 1, latched=True)
        subscribe_odometry(self, self._frame, self._on_odometry, depth=5)
        self.create_subscription(JointState, "joint_states", self._on_joint, 5)
        self.create_subscription(Range, "range", self._on_range, 5)
        for name, lidar in (("level", "horizontal"), ("nodding", "nodding")):
            scans = f"laser/{lidar}/scan"
            self.create_subscription(LaserScan, scans, partial(self._on_scan, name), 5)
        self.create_service("octomap_msgs/srv/GetOctomap", "~/octomap", self._on_get)
        self.create_service("volery_interfaces/srv/ByName", "~/save", self._on_save)
        self.create_service("volery_interfaces/srv/ByName", "~/load", self._on_load)
        self.create_timer(voxels_s, self._publish_voxels)
        self.create_timer(grid_s, self._publish_grid)
        self.create_timer(1.0, self._publish_status)

    # ------------------------------------------------------------------------------ subscriptions

    def _on_odometry(self, message: Odometry) -> None:
        self._frame.on_odometry(message)
        if not self._motion.add(OdometrySample.from_odometry(message)):
            return
        for name, intake in self._intakes.items():
            for rays in intake.ready(self._motion, self._nod if name == "nodding" else None):
                self._insert(rays)

    def _on_scan(self, name: str, scan: LaserScan) -> None:
        self._intakes[name].add(scan)

    def _on_joint(self, message: JointState) -> None:
        self._nod.add_message(message)

    def _on_range(self, message: Range) -> None:
        if math.isfinite(message.range):
            self._range = (self.get_clock().now_ns(), float(message.range))

    def _insert(self, rays: Rays) -> None:
        if len(rays.hits) == 0 or self._frame.is_lost:
            return
        rays = rays._replace(
            starts=self._frame.to_map(rays.starts), ends=self._frame.to_map(rays.ends)
        )
        self._octree.insert(rays, self._max_range_m)
        now, position = self.get_clock().now_ns(), rays.starts[len(rays.starts) // 2]
        self._ground.add(rays.ends, now, rays.hits)
        self._ground.fit(position, self._ground_below(float(position[2])), now)
        if position[2] - self._ground.height < _MIN_HEIGHT_M:
            return
        slope = self._ground.slope
        self._slab_z = float(position[2])
        self._grid.begin_at(position)
        height = float(position[2] - slope @ position[:2])
        self._grid.add(rays, HeightSlab(height, slope, self._half))

    def _ground_below(self, z: float) -> float | None:
        if self._range is None:
            return None
        received_ns, distance = self._range
        fresh = 0 <= self.get_clock().now_ns() - received_ns <= _SONAR_MEMORY_S * NS_PER_S
        return z - distance if fresh else None

    # ---------------------------------------------------------------------------------- publishers

    def _publish_voxels(self) -> None:
        if self._voxels.has_subscribers and self._octree.nodes:
            self._voxels.publish(self._message())

    def _message(self) -> Any:
        data, now = self._octree.binary(), self.get_clock().now_ns()
        return messages.octomap_message(data, self._resolution, MAP, now)

    def _publish_grid(self) -> None:
        if self._level.has_subscribers and self._grid.origin is not None:
            now = self.get_clock().now_ns()
            self._level.publish(messages.grid_message(self._grid, self._slab_z, MAP, now))

    def _publish_status(self) -> None:
        problems = self._problems()
        counts = {name: dict(sorted(i.counts.items())) for name, i in self._intakes.items()}
        status = {
            "state": "degraded" if problems else "mapping",
            "problems": problems,
            "scans": counts,
            "nodes": self._octree.nodes,
            "trimmed": self._octree.forgotten,
            "outside": self._grid.outside,
        }
        self._last_status = publish_status(self._status, status, self._last_status)

    def _problems(self) -> list[str]:
        """Returns the problems that keep the map from growing, as text."""
        now, found = self.get_clock().now_ns(), []
        newest = self._motion.newest
        if newest is None or now - newest.time_ns > _SILENT_S * NS_PER_S:
            found.append("no odometry")
        if self._frame.is_lost:
            found.append(UNKNOWN_POSE)
        for name, intake in self._intakes.items():
            received_ns, seen_ns = intake.received_ns, intake.seen_ns
            if received_ns is None or now - received_ns > _SILENT_S * NS_PER_S:
                found.append(f"the {name} LIDAR is silent")
            elif intake.stuck:
                found.append(f"the {name} LIDAR repeats itself")
            elif seen_ns is None or now - seen_ns > _SILENT_S * NS_PER_S:
                found.append(f"the {name} LIDAR has no returns")
        return found

    # ------------------------------------------------------------------------------------ services

    def _on_get(self, _request: Any, response: Any) -> Any:
        response.map = self._message()
        return response

    def _on_save(self, request: Any, response: Any) -> Any:
        return self._answer(response, lambda: self._save(request.name))

    def _on_load(self, request: Any, response: Any) -> Any:
        return self._answer(response, lambda: self._load(request.name))

    def _answer(self, response: Any, action: Any) -> Any:
        try:
            response.message = action()
            response.success = True
        except (DataFileError, NodeError) as error:
            response.success, response.message = False, str(error)
        return response

    def _save(self, name: str) -> str:
        path = self._path(name)
        if not path.exists() and len(list(path.parent.glob("*.bt"))) >= _MAX_FILES:
            raise NodeError(f"{path.parent} holds {_MAX_FILES} maps already; delete some")
        data = self._octree.binary()
        write_map(path, data, self._resolution)
        joined = f"{self._octree.nodes} in memory, where equal cubes are not joined"
        return f"{node_count(data)} nodes written to {path} ({joined})"

    def _load(self, name: str) -> str:
        path = self._path(name)
        found = read_map(path, self._limits)
        self._octree.take(path)
        nodes = f"{node_count(found.data)} nodes"
        return f"{nodes} read from {path}: {found.voxels.size} known cubes and their branches"

    def _path(self, name: str) -> Path:
        """Returns a file in the node's folder: clients of the graph can access no other."""
        if not self._folder:
            raise NodeError(f"node {self.full_name} stores no maps: its parameter folder is empty")
        if not name.endswith(".bt") or Path(name).name != name:
            raise NodeError(f"'{name}' is not a map name: use a plain file name that ends in .bt")
        return Path(self._folder) / name
