"""An oracle for scenes: all meshes flattened to one, cast with embreex's own Python call.

Each tree is stored as often as it occurs, so it suits small worlds. Point queries look at every
triangle. Results agree with those of `Scene` within 1e-4 m.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore import EmbreeDevice
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.workers import Workers
from volery.sensors.lidar.lidar import Echoes, RayBatch, move_bodies, scan_rays
from volery.sensors.lidar.lidar_model import LidarModel
from volery.sensors.lidar.measurement_kernels import Surfaces, measure_scan
from volery.vehicle.pose_history import PoseHistory
from volery.world.ground_cover import ground_material
from volery.world.mesh import Mesh, concatenate
from volery.world.scene import Scene
from volery.world.scene_content import MATERIALS, BodyShape, SceneContent
from volery.world.scene_memory import BodyTable, SceneHandle

DEVICE = EmbreeDevice()
"""Lives as long as the process, as embreex's devices allow TBB more threads than Volery's do: once
the last of them is gone, a TBB worker that then exceeds the limit spins for ever on one core."""

_SHORT_OF_TARGET_M = 1e-4
_FAR_M = 1e6


class FlatScene:
    """Meshes, one after the other, in one embreex scene."""

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        self._ends = np.cumsum([len(mesh) for mesh in meshes])
        whole = concatenate(list(meshes))
        self._scene: Any = None
        if len(whole):
            self._scene = EmbreeScene(DEVICE)
            self._mesh = TriangleMesh(
                self._scene, whole.vertices.copy(), whole.triangles.astype(np.int32)
            )

    def cast(
        self, origins: NDArray[np.float64], directions: NDArray[np.float64], limit: NDArray[Any]
    ) -> tuple[NDArray[np.bool_], NDArray[np.float32], NDArray[np.float64], NDArray[np.int64]]:
        """Which rays hit before `limit`; distance, normal and mesh number (of the hits)."""
        if self._scene is None or not len(origins):
            none = np.zeros(len(origins), dtype=bool)
            return none, np.zeros(0, np.float32), np.zeros((0, 3)), np.zeros(0, np.int64)
        found = self._scene.run(
            origins.astype(np.float32),
            directions.astype(np.float32),
            dists=limit.astype(np.float32),
            output=True,
        )
        hit = np.asarray(found["primID"] >= 0)
        mesh = np.searchsorted(self._ends, found["primID"][hit], side="right")
        return hit, found["tfar"][hit], found["Ng"][hit].astype(np.float64), mesh


class PlainScene(Scene):
    """A scene that uses embreex's public call."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.backend.close()
        self.backend = PlainBackend(self._content)


def plain_echoes(
    scene: PlainScene, model: LidarModel, batch: RayBatch, history: PoseHistory
) -> Echoes:
    """What `sample_echoes` yields, with intensities, in clear air."""
    scans, beams = len(batch.uav), model.beams
    shape = (scans, model.echoes, beams)
    echoes = Echoes(np.empty(shape, np.float32), np.empty(shape, np.float32))
    start = int(batch.sweep_start_ns.min())
    end = int(batch.sweep_start_ns.max()) + model.sweep_duration_ns
    move_bodies(scene, history, start, end)
    for scan in range(scans):
        surfaces = Surfaces(
            np.empty((1, beams), np.float32),
            np.empty((1, beams), np.float32),
            np.empty((1, beams), np.uint8),
        )
        origins, directions, times = scan_rays(model, batch, scan, history)
        normal, instance = np.empty((beams, 3), np.float32), np.empty(beams, np.int32)
        scene.backend.cast(
            scene.handle,
            scene.workers,
            origins,
            directions,
            model.range.max_m,
            np.array([batch.uav[scan]], dtype=np.int32),
            np.clip((times - start) / max(end - start, 1), 0.0, 1.0),
            (surfaces.distance[0], normal, instance, surfaces.material[0]),
        )
        surfaces.cosine[0] = np.abs(np.einsum("ij,ij->i", normal, directions))
        key, number = batch.key[scan], batch.scan_number[scan]
        sweep_start = batch.sweep_start_ns[scan]
        measure_scan(model.constants, key, number, sweep_start, scan, 0, surfaces, echoes)
    return echoes


class PlainBackend:
    """The same queries as `EmbreeBackend` through embreex's public call."""

    def __init__(self, content: SceneContent) -> None:
        self._shapes: list[FlatScene] = []
        self._flatten(content)

    def replace_solids(self, content: SceneContent, first: int) -> None:
        """Replace the content by `content`; everything is flattened again."""
        self._flatten(content)

    def _flatten(self, content: SceneContent) -> None:
        self._content = content
        self._blocks: list[tuple[int, int]] = []  # (instance, material) of each flattened mesh
        table = content.table
        flat = []
        self._corners: list[NDArray[np.float64]] = []  # (T, 3, 3) of each, without its rounding
        for instance in range(content.instances):
            matrix = table.transform[instance].reshape(3, 4)
            for k in range(int(table.part_count[instance])):
                part = content.parts[int(table.first_part[instance]) + k]
                mesh = Mesh(part.vertices[:-1], part.triangles)
                flat.append(mesh.transformed(matrix))
                self._corners.append(mesh.corners @ matrix[:, :3].T + matrix[:, 3])
                self._blocks.append((instance, k % MATERIALS))
        self._flat = FlatScene(flat)
        self._solids = FlatScene(flat[len(flat) - content.solids :])

    def handle(self, bodies: BodyTable) -> SceneHandle:
        """Tables as the main backend's, without an Embree scene: kernels cannot cast here."""
        content = self._content
        return SceneHandle(
            static=0,
            obstacles=0,
            steepest=content.steepest,
            moving_offset=content.instances,
            trees=content.trees,
            normal_matrix=content.normal_matrix,
            material=content.material,
            look=content.look,
            cover=content.cover,
            bodies=bodies,
        )

    def shape_scenes(self, shapes: Sequence[BodyShape]) -> NDArray[np.int64]:
        """Numbers of the shapes in this backend."""
        first = len(self._shapes)
        self._shapes.extend(FlatScene([mesh for mesh, _ in shape.parts]) for shape in shapes)
        return np.arange(first, len(self._shapes), dtype=np.int64)

    def cast(
        self,
        handle: SceneHandle,
        workers: Workers,
        origins: NDArray[np.float64],
        directions: NDArray[np.float64],
        reach: float,
        exclude: NDArray[np.int32],
        fraction: float | NDArray[np.float64],
        out: tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32], NDArray[np.uint8]],
    ) -> None:
        """Fill distance, normal, instance, material; `fraction` may be one a ray."""
        distance, normal, instance, material = out
        distance.fill(reach)
        normal.fill(0.0)
        instance.fill(-1)
        material.fill(0)
        hit, t, n, block = self._flat.cast(origins, directions, distance)
        distance[hit] = t
        normal[hit] = n
        blocks = np.array(self._blocks, dtype=np.int64).reshape(-1, 2)[block]
        instance[hit] = blocks[:, 0]
        part = np.where(blocks[:, 0] > self._content.trees, _looks_up(n), blocks[:, 1])
        material[hit] = handle.material[blocks[:, 0], part]
        ground = np.flatnonzero(hit)[blocks[:, 0] == 0]
        points = origins[ground] + distance[ground, None] * directions[ground]
        material[ground] = [ground_material(handle.cover, x, y) for x, y, _ in points]
        bodies = handle.bodies
        uavs = len(bodies.scene) - bodies.actors
        for row in range(len(bodies.scene)):
            own_copy = exclude // bodies.uavs_per_env == row // bodies.uavs_per_env
            seen = (exclude < 0) | ((exclude != row) & own_copy) | (row >= uavs)
            sees = np.broadcast_to(seen, len(origins))
            rows, o, d, turn = _in_body(bodies, row, sees, origins, directions, fraction, distance)
            hit, t, n, block = self._shapes[bodies.scene[row]].cast(o, d, distance[rows])
            rows = rows[hit]
            distance[rows] = t
            normal[rows] = rotations.rotate(turn[hit], n)
            instance[rows] = handle.moving_offset + row
            material[rows] = bodies.material[row][block]
        length = np.linalg.norm(normal, axis=1)
        facing = np.einsum("ij,ij->i", normal, directions)
        scale = np.where(facing > 0.0, -1.0, 1.0) / np.where(length > 0.0, length, 1.0)
        normal *= scale[:, None].astype(np.float32)
        distance[instance < 0] = np.inf

    def occluded(
        self,
        handle: SceneHandle,
        workers: Workers,
        origins: NDArray[np.float64],
        targets: NDArray[np.float64],
        exclude: NDArray[np.int32],
        fraction: float,
        out: NDArray[np.bool_],
    ) -> None:
        """Fill `out`."""
        count = len(origins)
        length = np.linalg.norm(targets - origins, axis=1)
        directions = (targets - origins) / np.where(length > 0.0, length, 1.0)[:, None]
        found = (
            np.empty(count, np.float32),
            np.empty((count, 3), np.float32),
            np.empty(count, np.int32),
            np.empty(count, np.uint8),
        )
        reach = float(length.max(initial=0.0))
        self.cast(handle, workers, origins, directions, reach, exclude, fraction, found)
        out[:] = (found[2] >= 0) & (found[0] < length - _SHORT_OF_TARGET_M)

    def clearance(
        self,
        points: NDArray[np.float64],
        reach: float,
        include_terrain: bool,
        out: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32]],
    ) -> None:
        """Fill distance, nearest, instance."""
        first = 0 if include_terrain else 1
        wanted = [k for k, (instance, _) in enumerate(self._blocks) if instance >= first]
        corners = np.concatenate([np.zeros((0, 3, 3)), *(self._corners[k] for k in wanted)])
        owners = [np.full(len(self._corners[k]), self._blocks[k][0]) for k in wanted]
        owner = np.concatenate([np.zeros(0, np.int64), *owners])
        distance, nearest, instance = out
        distance[:], nearest[:], instance[:] = reach, points, -1
        for i, point in enumerate(points):
            points = nearest_on_triangles(point, corners)
            away = np.linalg.norm(points - point, axis=1)
            k = int(away.argmin()) if len(away) else -1
            if k >= 0 and away[k] < reach:
                distance[i], nearest[i], instance[i] = away[k], points[k], owner[k]

    def enclosing(self, points: NDArray[np.float64], out: NDArray[np.int32]) -> None:
        """Fill `out` with the closed solid that each point lies in, -1 for none."""
        up = np.tile([0.0, 0.0, 1.0], (len(points), 1))
        hit, _, normal, solid = self._solids.cast(points, up, np.full(len(points), _FAR_M))
        out.fill(-1)
        first = self._content.instances - self._content.solids
        out[hit] = np.where(normal[:, 2] > 0.0, first + solid, -1)

    def close(self) -> None:
        """Forget the scenes."""
        self._shapes.clear()


def nearest_on_triangles(
    point: NDArray[np.float64], corners: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(T, 3) m, the nearest point of each triangle (T, 3, 3) to a point (3,)."""
    edges = np.roll(corners, -1, axis=1) - corners
    to_point = point - corners
    squared = np.einsum("tij,tij->ti", edges, edges)
    along = np.einsum("tij,tij->ti", to_point, edges) / np.where(squared > 0.0, squared, 1.0)
    on_edges = corners + np.clip(along, 0.0, 1.0)[..., None] * edges
    best = np.linalg.norm(on_edges - point, axis=2).argmin(axis=1)
    nearest = np.asarray(on_edges[np.arange(len(corners)), best])
    normal = np.cross(edges[:, 0], edges[:, 1])
    sides = np.einsum("tij,tj->ti", np.cross(edges, to_point), normal)
    area = np.einsum("ti,ti->t", normal, normal)
    over = (sides >= 0.0).all(axis=1) & (area > 0.0)
    height = np.einsum("ti,ti->t", to_point[:, 0], normal)[over] / area[over]
    nearest[over] = point - height[:, None] * normal[over]
    return nearest


def _looks_up(normal: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Whether outward normals (n, 3) of any length point up more than sideways."""
    x, y, z = normal.T
    return np.asarray((z > 0.0) & (z * z > x * x + y * y))


def _in_body(
    bodies: BodyTable,
    row: int,
    sees: NDArray[np.bool_],
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
    fraction: float | NDArray[np.float64],
    limit: NDArray[np.float32],
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Rays that may touch a body: their rows, and origins, directions, attitudes in its frame."""
    f = np.broadcast_to(np.asarray(fraction, dtype=np.float64), len(origins))[:, None]
    start, end = bodies.start[row], bodies.end[row]
    position = (1.0 - f) * start[:3] + f * end[:3]
    sign = -1.0 if start[3:] @ end[3:] < 0.0 else 1.0
    attitude = rotations.normalize((1.0 - f) * start[3:] + sign * f * end[3:])
    towards = position - origins
    along = np.einsum("ij,ij->i", towards, directions)
    squared = np.einsum("ij,ij->i", towards, towards) - along * along
    radius = bodies.radius[row]
    touched = sees & (squared <= radius**2 + 1e-6) & (along >= -radius) & (along <= limit + radius)
    rows = np.flatnonzero(touched)
    back = rotations.conjugate(attitude[rows])
    return (
        rows,
        rotations.rotate(back, -towards[rows]),
        rotations.rotate(back, directions[rows]),
        attitude[rows],
    )
