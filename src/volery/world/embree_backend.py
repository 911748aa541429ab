"""Instanced scenes in Embree: each tree model is stored once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volery.core.workers import Workers, new_counter
from volery.world import embree
from volery.world.point_query import (
    callback_address,
    nearest_points,
    query_memory,
    world_row,
)
from volery.world.scene_content import MATERIALS, BodyShape, SceneContent
from volery.world.scene_kernels import CHUNK, cast_rays, find_enclosing, find_occluded
from volery.world.scene_memory import ONE_WORLD, BodyTable, SceneHandle, thread_block

FEW_RAYS = 5000
"""Maximum size of a batch that the calling thread casts alone: waking others costs more."""


class EmbreeBackend:
    """Ray casting and point queries through Embree's C interface.

    Raises `EmbreeError` if the scene cannot be built. Points and rays are in the map frame, m.
    """

    def __init__(self, content: SceneContent) -> None:
        self._content = content
        self._device = embree.Device()
        try:
            embree.self_test(self._device)
            self._build()
        except BaseException:
            self._device.close()
            raise
        self._shapes: dict[int, int] = {}

    def _build(self) -> None:
        content, device = self._content, self._device
        # Robust: no ray passes between two triangles of the ground, not even straight down at a
        # grid point. Trees do without, for speed: a ray hits an edge of theirs only by chance.
        self._static = device.new_scene(flags=embree.SCENE_ROBUST)
        self._obstacles = device.new_scene(flags=embree.SCENE_ROBUST)  # without the ground
        feet = [self._tree_piece(first, 0) for first in content.tree_parts]
        crowns = [self._tree_piece(first, MATERIALS) for first in content.tree_parts]
        if content.has_terrain:
            device.attach_mesh([self._static], 0, content.parts[0])
        both = [self._static, self._obstacles]
        for first, pieces in ((1, feet), (1 + content.trees, crowns)):
            rows = np.flatnonzero([pieces[i] != 0 for i in content.tree_model])
            device.attach_instances(
                both,
                first + rows,
                [pieces[i] for i in content.tree_model[rows]],
                content.tree_transforms[rows],
            )
        self._attach_solids(1 + content.trees)

    def replace_solids(self, content: SceneContent, first: int) -> None:
        """Replaces the content, whose instances differ from `first` on, all of them solids.

        The ground, the trees and the solids before `first` are unchanged.
        """
        both = [self._static, self._obstacles]
        for number in range(first, self._content.instances):
            part = self._content.solid_part(number)
            if len(part.triangles):
                self._device.detach_mesh(both, self._content.trees + number, part)
        self._content = content
        self._attach_solids(first)

    def _attach_solids(self, first: int) -> None:
        both = [self._static, self._obstacles]
        self._query_row = world_row(self._content.table, self._content.trees)
        for number in range(first, self._content.instances):
            part = self._content.solid_part(number)
            if len(part.triangles):  # numbered behind the trees' crowns, see `instance_of`
                self._device.attach_mesh(both, self._content.trees + number, part)
        for scene in both:
            self._device.commit(scene)

    def _tree_piece(self, first: int, part: int) -> int:
        """Returns the scene of the foot or crown whose parts begin at `part`; 0 if empty."""
        parts = range(part, part + MATERIALS)
        meshes = {k: self._content.parts[first + k] for k in parts}
        if not any(len(mesh.triangles) for mesh in meshes.values()):
            return 0
        scene = self._device.new_scene()
        for k, mesh in meshes.items():
            if len(mesh.triangles):
                self._device.attach_mesh([scene], k, mesh)
        self._device.commit(scene)
        return scene

    def handle(self, bodies: BodyTable) -> SceneHandle:
        """Returns the scene for kernels, with these bodies."""
        content = self._content
        return SceneHandle(
            static=self._static,
            obstacles=self._obstacles,
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
        """Returns new Embree scenes (K,) of K body shapes."""
        device = self._device
        scenes = []
        for shape in shapes:
            scene = device.new_scene()
            for number, (mesh, _) in enumerate(shape.parts):
                if len(mesh):
                    device.attach_mesh([scene], number, embree.padded(mesh))
            device.commit(scene)
            scenes.append(scene)
        return np.array(scenes, dtype=np.int64)

    def cast(
        self,
        handle: SceneHandle,
        workers: Workers,
        origins: NDArray[np.float64],
        directions: NDArray[np.float64],
        max_range: float,
        exclude: NDArray[np.int32],
        fraction: float,
        out: tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32], NDArray[np.uint8]],
    ) -> None:
        """Fills distance (R,), normal (R, 3), instance (R,), material (R,) of `Scene.cast`."""
        counter, bodies = new_counter(), len(handle.bodies.scene)

        def work() -> None:
            block = thread_block(CHUNK, bodies)
            cast_rays(
                handle, origins, directions, max_range, exclude, fraction, counter, block, *out
            )

        workers.run(work, alone=len(origins) <= FEW_RAYS)

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
        """Fills `out` (R,) of `Scene.occluded`."""
        counter, bodies = new_counter(), len(handle.bodies.scene)

        def work() -> None:
            block = thread_block(CHUNK, bodies)
            find_occluded(handle, origins, targets, exclude, fraction, counter, block, out)

        workers.run(work, alone=len(origins) <= FEW_RAYS)

    def clearance(
        self,
        points: NDArray[np.float64],
        max_distance: float,
        include_terrain: bool,
        out: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32]],
    ) -> None:
        """Fills distance (P,), nearest (P, 3), instance (P,) of `Scene.clearance`."""
        scenes, tables = self.query_rows(include_terrain)
        memory = query_memory()
        nearest_points(
            scenes, callback_address(), tables, ONE_WORLD.world, points, max_distance, memory, *out
        )

    def query_rows(self, include_terrain: bool) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Returns scenes (1,) and tables (1, 5) of this world for `nearest_points`."""
        scene = self._static if include_terrain else self._obstacles
        return np.array([scene], np.int64), self._query_row[None]

    def enclosing(self, points: NDArray[np.float64], out: NDArray[np.int32]) -> None:
        """Fills `out` (P,) with the closed solid around each point (P, 3), -1 for none."""
        find_enclosing(
            self._obstacles, self._content.trees, points, thread_block(embree.LANES, 0), out
        )

    def close(self) -> None:
        """Releases all handles."""
        self._device.close()
