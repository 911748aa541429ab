"""The scene: all objects that rays can hit, and its queries.

Instances are numbered: -1 nothing, 0 the terrain, 1..T the trees in forest order, then the solids,
then, from `moving_offset`, one moving body per UAV, then the actors. Embree casts the rays
(`embree_backend`).
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.plurals import counted
from volery.core.workers import Workers
from volery.world.actors.moving import MovingActors
from volery.world.embree_backend import EmbreeBackend
from volery.world.ground_cover import BARE_GROUND, GroundCover
from volery.world.moving_bodies import NO_ROWS, body_rows, body_table, with_blades
from volery.world.scene_content import BodyShape, Look, Solid, collect, with_solids
from volery.world.scene_memory import SceneHandle
from volery.world.terrain import Terrain
from volery.world.trees.model import DetailLevel

if TYPE_CHECKING:
    from volery.world.forest import Forest

__all__ = ["BodyShape", "Clearance", "Hits", "Look", "Scene", "Solid"]


class Hits(NamedTuple):
    """Closest hits of R rays."""

    distance: NDArray[np.float32]
    """(R,) m; inf without a hit."""
    normal: NDArray[np.float32]
    """(R, 3) unit, map, on the side of the ray's origin; zero without a hit."""
    instance: NDArray[np.int32]
    """(R,) scene instance; -1 without a hit."""
    material: NDArray[np.uint8]
    """(R,) `Material`."""


class Clearance(NamedTuple):
    """Nearest surface points of P points."""

    distance: NDArray[np.float64]
    """(P,) m; the maximum distance if nothing is nearer. Negative inside a closed solid."""
    nearest: NDArray[np.float64]
    """(P, 3) m, map; the point itself if nothing is nearer."""
    instance: NDArray[np.int32]
    """(P,) scene instance; -1 if nothing is nearer; the solid for points inside a closed one."""


class Scene:
    """Static world, whose solids can be replaced, plus the moving bodies of UAVs and actors.

    `threads` share batches above 5,000 rays; results do not depend on their number, bit for bit.
    Raises `EmbreeUnavailableError` if Embree's library is missing or of another version.
    """

    def __init__(
        self,
        terrain: Terrain | None,
        forest: Forest | None,
        *,
        detail: DetailLevel = DetailLevel.SENSING,
        solids: Sequence[Solid] = (),
        cover: GroundCover = BARE_GROUND,
        threads: int = 1,
    ) -> None:
        self.workers = Workers(threads)
        self.solids = tuple(solids)
        self._content = collect(terrain, forest, detail, self.solids, cover)
        self.backend = EmbreeBackend(self._content)
        self.actors: MovingActors | None = None
        """Actors, which all rays see."""
        self._uav_rows, self._actor_rows, self._uavs_per_env = NO_ROWS, NO_ROWS, 1
        self._bodies = body_table(NO_ROWS, NO_ROWS, 1)
        self._is_twin = False

    def __repr__(self) -> str:
        static = counted(self._content.instances, "static instance")
        return f"<scene: {static}, {counted(len(self._uav_rows.scene), 'moving UAV')}>"

    @property
    def moving_offset(self) -> int:
        """Instance number of the first UAV's body."""
        return self._content.instances

    @property
    def handle(self) -> SceneHandle:
        """Scene for casting in compiled kernels; valid while the scene is open."""
        return self.backend.handle(self._bodies)

    def handle_with_blades(
        self, start: NDArray[np.float64], end: NDArray[np.float64]
    ) -> SceneHandle:
        """Returns a handle whose rays see the blades of turning rotors instead of discs.

        start, end: (N, R or more) rad, rotor angles at either end of the interval.
        """
        return self.backend.handle(with_blades(self._bodies, self._uav_rows, start, end))

    def twin(self) -> Scene:
        """Returns the same static world and actors with separate UAVs, for another thread.

        The twin is valid as long as this scene, and casts in the calling thread.
        """
        twin = copy.copy(self)
        twin.workers = Workers(1)
        twin._uav_rows = NO_ROWS
        twin._bodies = body_table(NO_ROWS, self._actor_rows, 1)
        twin._is_twin = True
        return twin

    def close(self) -> None:
        """Releases memory and threads; the scene must not be used afterwards."""
        self.workers.close()
        if not self._is_twin:
            self.backend.close()

    def replace_solids(self, solids: Sequence[Solid]) -> int:
        """Replaces the solids; must not run during a query.

        Leading solids that are the same objects as before are not rebuilt, nor are ground and
        trees. Twins must not be used afterwards. Returns the first instance number that changed.
        Raises `ValueError` if called on a twin.
        """
        if self._is_twin:
            raise ValueError("a twin cannot replace solids; call replace_solids of its scene")
        pairs = zip(self.solids, solids, strict=False)
        kept = sum(1 for _ in itertools.takewhile(lambda pair: pair[0] is pair[1], pairs))
        first = 1 + self._content.trees + kept
        self._content = with_solids(self._content, kept, solids[kept:])
        self.solids = tuple(solids)
        self.backend.replace_solids(self._content, first)
        return first

    def instance_name(self, instance: int, uav: int = 0) -> str:  # noqa: ARG002
        """Returns an instance's name: "ground", "tree 17", a solid's or actor's name, "uav3".

        uav: row of a UAV in the instance's world, for a `WorldScenes`.
        """
        if instance < 0:
            return "nothing"
        if instance == 0:
            return "ground"
        if instance <= self._content.trees:
            return f"tree {instance}"
        if instance < self.moving_offset:
            return self.solids[instance - 1 - self._content.trees].name
        row, uavs = instance - self.moving_offset, len(self._uav_rows.scene)
        if self.actors is not None and row >= uavs:
            return self.actors.names[row - uavs]
        return f"uav{row + 1}"

    def set_bodies(
        self, shapes: Sequence[BodyShape], shape_index: ArrayLike, *, num_envs: int = 1
    ) -> None:
        """Creates a UAV body for each entry of `shape_index` (N,); `move_bodies` places them.

        Until then they are far below the map. `num_envs`: number of independent environments,
        one copy after the other; a UAV's rays see its own copy alone. Raises `ValueError` if an
        index is out of range.
        """
        index = np.asarray(shape_index, dtype=np.int64).reshape(-1)
        if index.size and (index.min() < 0 or index.max() >= len(shapes)):
            raise ValueError(f"shape_index must be in 0..{len(shapes) - 1}")
        rows = body_rows(shapes, index, self.backend.shape_scenes(shapes))
        uavs_per_env = max(len(index) // num_envs, 1)
        self._bodies = body_table(rows, self._actor_rows, uavs_per_env)
        self._uav_rows, self._uavs_per_env = rows, uavs_per_env

    def set_actors(self, actors: MovingActors) -> None:
        """Adds `actors`, which all rays see; `move_actors` places them."""
        scenes = self.backend.shape_scenes(actors.shapes)
        self.actors = actors
        self._actor_rows = body_rows(actors.shapes, np.arange(len(scenes)), scenes)
        self._bodies = body_table(self._uav_rows, self._actor_rows, self._uavs_per_env)

    def move_bodies(
        self,
        position: ArrayLike,
        attitude: ArrayLike,
        end_position: ArrayLike | None = None,
        end_attitude: ArrayLike | None = None,
    ) -> None:
        """Places the UAVs' bodies: position (N, 3) m, attitude (N, 4) map from body.

        With a second pose the bodies move from the first to the second, and a ray sees them at its
        own fraction of that interval.
        """
        start, end = (table[: len(self._uav_rows.scene)] for table in self._poses)
        start[:, :3] = position
        start[:, 3:] = attitude
        end[:, :3] = position if end_position is None else end_position
        end[:, 3:] = attitude if end_attitude is None else end_attitude

    def move_actors(self, start_ns: int, end_ns: int) -> None:
        """Places the actors at their poses of two simulated times, as `move_bodies` does UAVs."""
        if self.actors is not None:
            for table, time_ns in zip(self._poses, (start_ns, end_ns), strict=True):
                table[len(self._uav_rows.scene) :] = self.actors.poses_at(time_ns)

    @property
    def _poses(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self._bodies.start, self._bodies.end

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
        """Returns the closest hits of rays: origins (R, 3) m, unit directions (R, 3), map.

        max_range_m: maximum distance. exclude: row of the UAV whose own body the rays do not see,
        or one per ray (R,); -1: none. fraction: of the bodies' interval of motion; 1 is the newest
        pose. out: an earlier result for as many rays, whose memory is reused, which speeds up large
        batches. Raises `ValueError` for arrays of a wrong shape.
        """
        o, d = _ray_arrays(origins, directions, "directions")
        count = len(o)
        hits = out if out is not None else _new_hits(count)
        if len(hits.distance) != count:
            raise ValueError(f"out holds {len(hits.distance)} results, not {count}")
        self.backend.cast(
            self.handle,
            self.workers,
            o,
            d,
            float(max_range_m),
            _rows(exclude, count),
            float(fraction),
            hits,
        )
        return hits

    def occluded(
        self,
        origins: ArrayLike,
        targets: ArrayLike,
        exclude: int | ArrayLike = -1,
        *,
        fraction: float = 1.0,
    ) -> NDArray[np.bool_]:
        """Returns whether anything lies between origins (R, 3) and targets (R, 3), m, map: (R,).

        The last .1 mm before the target do not count, so a surface does not hide its own points.
        exclude, fraction: see `cast`. Raises `ValueError` for arrays of a wrong shape.
        """
        o, t = _ray_arrays(origins, targets, "targets")
        result = np.empty(len(o), dtype=np.bool_)
        self.backend.occluded(
            self.handle, self.workers, o, t, _rows(exclude, len(o)), float(fraction), result
        )
        return result

    def clearance(
        self,
        points: ArrayLike,
        max_distance_m: float,
        include_terrain: bool = True,
        *,
        uavs: NDArray[np.int64] | None = None,
    ) -> Clearance:
        """Returns the nearest point of the static world to each point (P, 3), m, map.

        The static world consists of trees, solids and, unless excluded, the terrain;
        `max_distance_m` is the maximum distance. `Solid` defines the inside of a solid. uavs: (P,)
        rows of the UAVs at the points, whose worlds a `WorldScenes` asks. Raises `ValueError` if
        points are not finite or the distance is negative.
        """
        p = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
        if not np.isfinite(p).all():
            raise ValueError("points must be finite")
        if not max_distance_m >= 0.0:
            raise ValueError(f"max_distance_m must not be negative, not {max_distance_m}")
        result = Clearance(
            np.empty(len(p)), np.empty((len(p), 3)), np.empty(len(p), dtype=np.int32)
        )
        self._nearest(p, float(max_distance_m), include_terrain, uavs, result)
        return result

    def _nearest(
        self,
        p: NDArray[np.float64],
        max_distance_m: float,
        include_terrain: bool,
        uavs: NDArray[np.int64] | None,  # noqa: ARG002 - for subclasses
        result: Clearance,
    ) -> None:
        """Fills `result` of `clearance`."""
        self.backend.clearance(p, max_distance_m, include_terrain, result)
        if self.solids:
            enclosing = self.enclosing(p)
            inside = enclosing >= 0
            result.distance[inside] *= -1.0
            result.instance[inside] = enclosing[inside]

    def enclosing(self, points: ArrayLike) -> NDArray[np.int32]:
        """Returns the solid's instance (P,) around each of the points (P, 3), m, map; -1: none."""
        p = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
        found = np.empty(len(p), dtype=np.int32)
        self.backend.enclosing(p, found)
        first = 1 + self._content.trees
        for k in np.flatnonzero(found >= first):
            if self.solids[found[k] - first].is_shell:
                found[k] = -1
        return found


def _new_hits(count: int) -> Hits:
    return Hits(
        np.empty(count, np.float32),
        np.empty((count, 3), np.float32),
        np.empty(count, np.int32),
        np.empty(count, np.uint8),
    )


def _ray_arrays(
    origins: ArrayLike, others: ArrayLike, name: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    o = np.ascontiguousarray(origins, dtype=np.float64).reshape(-1, 3)
    d = np.ascontiguousarray(others, dtype=np.float64).reshape(-1, 3)
    if len(o) != len(d):
        raise ValueError(f"{len(o)} origins but {len(d)} {name}")
    with np.errstate(all="ignore"):  # one pass without temporary arrays: NaN and inf reach the sum
        fine = np.isfinite(o.sum()) and np.isfinite(d.sum())
    if not fine:
        raise ValueError(f"origins and {name} must be finite")
    return o, d


def _rows(exclude: int | ArrayLike, count: int) -> NDArray[np.int32]:
    rows = np.ascontiguousarray(exclude, dtype=np.int32).reshape(-1)
    if len(rows) not in {1, count}:
        raise ValueError(f"exclude has {len(rows)} entries for {count} rays")
    return rows
