"""Scenes of several worlds, for environments that are in different ones."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.errors import ScenarioError
from volery.world.point_query import callback_address, nearest_points, query_memory
from volery.world.scene import BodyShape, Clearance, Hits, Scene, Solid
from volery.world.scene_memory import SceneHandle, WorldTable


class WorldScenes(Scene):
    """The scenes of W worlds with the same ground, as one: a UAV sees the world of its environment.

    Rays and queries of each UAV return what they return in the scene of that world, to the bit,
    numbers of instances included. One batch of rays serves all worlds. Queries without the row of a
    UAV concern the first world. Environments begin in the first world; see `set_worlds`.

    build: returns the scene of a world, by number, when an environment first enters it.
    """

    def __init__(self, count: int, build: Callable[[int], Scene]) -> None:
        first = build(0)
        self.__dict__.update(first.__dict__)
        self._tables = _Tables(first, count, build)
        self._world = np.zeros(1, np.int32)
        """(E,) number of the world of each environment."""

    def set_worlds(self, envs: NDArray[np.int64], worlds: NDArray[np.int64]) -> None:
        """Moves the environments `envs` (R,) to the worlds number `worlds` (R,).

        Raises `ScenarioError` if the ground of a world differs, and what `build` raises.
        """
        self._tables.require(worlds)
        self._world[envs] = worlds

    @property
    def handle(self) -> SceneHandle:
        """Scene for casting in compiled kernels; see `world_kernels`."""
        return self._tables.of_all(super().handle, self._world)

    def handle_with_blades(
        self, start: NDArray[np.float64], end: NDArray[np.float64]
    ) -> SceneHandle:
        """Returns a handle whose rays see the blades of turning rotors; see `Scene`."""
        return self._tables.of_all(super().handle_with_blades(start, end), self._world)

    def twin(self) -> WorldScenes:
        """Returns the same worlds with separate UAVs, for another thread; see `Scene.twin`."""
        twin = super().twin()
        assert isinstance(twin, WorldScenes)
        twin._world = np.zeros(1, np.int32)
        return twin

    def set_bodies(
        self, shapes: Sequence[BodyShape], shape_index: ArrayLike, *, num_envs: int = 1
    ) -> None:
        """Creates the bodies of `num_envs` environments, all in the first world; see `Scene`."""
        super().set_bodies(shapes, shape_index, num_envs=num_envs)
        self._world = np.zeros(num_envs, np.int32)

    def close(self) -> None:
        """Releases the memory of all worlds."""
        if not self._is_twin:
            self._tables.close()

    def replace_solids(self, solids: Sequence[Solid]) -> int:  # noqa: ARG002
        """Raises `ValueError`: the solids of several worlds cannot be replaced."""
        raise ValueError("solids of several worlds cannot be replaced")

    def instance_name(self, instance: int, uav: int = 0) -> str:
        """Returns the name of an instance in the world of a UAV; see `Scene`."""
        return self._tables.scene(int(self._world_of(np.array([uav]))[0])).instance_name(instance)

    def cast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        max_range_m: float,
        exclude: int | ArrayLike = -1,
        *,
        fraction: float = 1.0,
        out: Hits | None = None,
    ) -> Hits:
        """Returns the closest hits of rays in the worlds of the UAVs `exclude`; see `Scene.cast`.

        Rays of no UAV see the first world.
        """
        rows = np.asarray(exclude)
        if rows.ndim == 0:
            rows = np.full(len(np.asarray(origins).reshape(-1, 3)), int(rows))
        origins, directions = np.asarray(origins), np.asarray(directions)
        world = self._world_of(rows)
        parts: list[tuple[NDArray[np.int64], Hits]] = []
        for w in np.unique(world).tolist():
            own = np.flatnonzero(world == w)
            alone = self._alone(w)
            hits = alone.cast(
                origins[own], directions[own], max_range_m, rows[own], fraction=fraction
            )
            parts.append((own, hits))
        if len(parts) == 1 and out is None:
            return parts[0][1]
        return _merged(len(rows), parts, out)

    def _nearest(
        self,
        p: NDArray[np.float64],
        max_distance_m: float,
        include_terrain: bool,
        uavs: NDArray[np.int64] | None,
        result: Clearance,
    ) -> None:
        if uavs is None:
            super()._nearest(p, max_distance_m, include_terrain, None, result)
            return
        world = self._world_of(uavs)
        if not self._tables.has_solids:
            scenes, tables = self._tables.query_rows[include_terrain]
            nearest_points(
                scenes,
                callback_address(),
                tables,
                world,
                p,
                max_distance_m,
                query_memory(),
                *result,
            )
            return
        for w in np.unique(world).tolist():
            own = np.flatnonzero(world == w)
            found = self._tables.scene(w).clearance(p[own], max_distance_m, include_terrain)
            pairs: Iterator[tuple[Any, Any]] = zip(result, found, strict=True)
            for whole, part in pairs:
                whole[own] = part

    def _world_of(self, uavs: NDArray[np.int64]) -> NDArray[np.int32]:
        """Returns the number of the world (P,) of each of the UAVs `uavs` (P,), -1 for none."""
        envs = np.maximum(uavs, 0) // self._uavs_per_env
        return np.where(uavs < 0, np.int32(0), self._world[envs])

    def _alone(self, world: int) -> Scene:
        """Returns the scene of one world with the UAVs of all environments."""
        alone = copy.copy(self._tables.scene(world))
        alone.workers = self.workers
        alone._uav_rows, alone._uavs_per_env = self._uav_rows, self._uavs_per_env
        alone._bodies, alone.actors = self._bodies, self.actors
        return alone


class _Tables:
    """The tables of the worlds that are built, one after the other; all twins share them."""

    def __init__(self, first: Scene, count: int, build: Callable[[int], Scene]) -> None:
        self._build = build
        self._scenes: list[Scene | None] = [first, *[None] * (count - 1)]
        self._gather()

    def require(self, worlds: NDArray[np.int64]) -> None:
        """Builds those of `worlds` that are not built yet."""
        missing = [w for w in np.unique(worlds).tolist() if self._scenes[w] is None]
        for w in missing:
            self._scenes[w] = self._build(w)
        if missing:
            self._gather()

    def scene(self, world: int) -> Scene:
        """Returns the scene of a world that is built."""
        scene = self._scenes[world]
        assert scene is not None
        return scene

    def of_all(self, handle: SceneHandle, world: NDArray[np.int32]) -> SceneHandle:
        """Returns the handle of one world as that of all; world: (E,) of the environments."""
        return handle._replace(
            normal_matrix=self._normal_matrix,
            material=self._material,
            look=self._look,
            worlds=self._worlds._replace(world=world),
        )

    def close(self) -> None:
        """Releases the memory of all worlds."""
        for scene in self._scenes:
            if scene is not None:
                scene.close()

    def _gather(self) -> None:
        """Computes the tables; a world that is not built has no rows."""
        first = self.scene(0)
        scenes = [first if scene is None else scene for scene in self._scenes]
        handles = [scene.handle for scene in scenes]
        is_built = [scene is not None for scene in self._scenes]
        for handle in handles[1:]:
            pairs: Iterator[tuple[Any, Any]] = zip(handle.cover, handles[0].cover, strict=True)
            if not all(np.array_equal(a, b) for a, b in pairs):
                raise ScenarioError("the worlds of environments must have the same ground cover")
        built = [handle for handle, there in zip(handles, is_built, strict=True) if there]
        self._normal_matrix = np.concatenate([handle.normal_matrix for handle in built])
        self._material = np.concatenate([handle.material for handle in built])
        self._look = np.concatenate([handle.look for handle in built])
        rows = [len(h.material) if there else 0 for h, there in zip(handles, is_built, strict=True)]
        self._worlds = WorldTable(
            np.zeros(1, np.int32),
            np.array([handle.static for handle in handles], np.int64),
            np.array([handle.obstacles for handle in handles], np.int64),
            np.array([handle.steepest for handle in handles], np.float64),
            np.array([handle.trees for handle in handles], np.int64),
            np.cumsum([0, *rows], dtype=np.int64),
        )
        self.query_rows = {
            whole: _stacked([scene.backend.query_rows(whole) for scene in scenes])
            for whole in (False, True)
        }
        self.has_solids = any(scene.solids for scene in scenes)


def _stacked(
    rows: Sequence[tuple[NDArray[np.int64], NDArray[np.int64]]],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    scenes, tables = zip(*rows, strict=True)
    return np.concatenate(scenes), np.concatenate(tables)


def _merged(count: int, parts: list[tuple[NDArray[np.int64], Hits]], out: Hits | None) -> Hits:
    """Returns the hits of `count` rays; a part holds the rays' numbers and their hits."""
    whole = out or Hits(
        np.full(count, np.inf, np.float32),
        np.zeros((count, 3), np.float32),
        np.full(count, -1, np.int32),
        np.zeros(count, np.uint8),
    )
    for rows, hits in parts:
        pairs: Iterator[tuple[Any, Any]] = zip(whole, hits, strict=True)
        for array, part in pairs:
            array[rows] = part
    return whole
