"""The plain way: everything flattened to one mesh, cast with embreex's own Python call.

It serves where `world.embree` finds no library, and as its check. A tree is stored as often as it
stands, so it suits small worlds: a forest of 5,000 trees takes gigabytes. Point queries look at
every triangle nearby, compiled. Results agree with the main backend's within 1e-4 m.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.workers import Workers
from volery.world.ground_cover import ground_material
from volery.world.mesh import Mesh, concatenate
from volery.world.point_query import nearest_in_all
from volery.world.scene_content import MATERIALS, BodyShape, SceneContent
from volery.world.scene_memory import BodyTable, SceneHandle

_SHORT_OF_TARGET_M = 1e-4
_FAR_M = 1e6


class FlatScene:
    """Meshes, one after the other, in one embreex scene."""

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._ends = np.cumsum([len(mesh) for mesh in meshes])
        whole = concatenate(list(meshes))
        self._scene: Any = None
        if len(whole):
            self._scene = EmbreeScene()
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


class EmbreexBackend:
    """The same queries as `EmbreeBackend` through embreex's public call."""

    def __init__(self, content: SceneContent) -> None:
        self._shapes: list[FlatScene] = []
        self._flatten(content)

    def replace_solids(self, content: SceneContent, first: int) -> None:  # noqa: ARG002
        """Go on with `content`; everything is flattened anew."""
        self._flatten(content)

    def _flatten(self, content: SceneContent) -> None:
        self._content = content
        self._blocks: list[tuple[int, int]] = []  # (instance, material) of each flattened mesh
        table = content.table
        flat = []
        for instance in range(content.instances):
            matrix = table.transform[instance].reshape(3, 4)
            for k in range(int(table.part_count[instance])):
                part = content.parts[int(table.first_part[instance]) + k]
                flat.append(Mesh(part.vertices[:-1], part.triangles).transformed(matrix))
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
        workers: Workers,  # noqa: ARG002 - embreex's call uses one thread
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
        places = origins[ground] + distance[ground, None] * directions[ground]
        material[ground] = [ground_material(handle.cover, x, y) for x, y, _ in places]
        bodies = handle.bodies
        uavs = len(bodies.scene) - bodies.things
        for row in range(len(bodies.scene)):
            own_copy = exclude // bodies.crew == row // bodies.crew
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
        nearest_in_all(self._content.table, 0 if include_terrain else 1, points, reach, *out)

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
