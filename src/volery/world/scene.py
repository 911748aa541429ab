"""The scene: everything a ray can hit, and the questions one can ask of it.

Instances are numbered: -1 nothing, 0 the terrain, 1..T the trees in forest order, then the solids,
then, from `moving_offset`, one moving body a UAV. Rays are cast by Embree (`embree_backend`), or,
where its library cannot be used, through embreex's public call (`embreex_fallback`).
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.workers import Workers
from volery.world.embree import EmbreeUnavailableError
from volery.world.embree_backend import EmbreeBackend
from volery.world.embreex_fallback import EmbreexBackend
from volery.world.materials import Material
from volery.world.scene_content import BodyShape, SceneContent, Solid, collect, rotor_table
from volery.world.scene_memory import BodyTable, SceneHandle
from volery.world.terrain import Terrain
from volery.world.trees.model import DetailLevel

if TYPE_CHECKING:
    from volery.world.forest import Forest

__all__ = ["BodyShape", "Clearance", "Hits", "Scene", "Solid"]

Backend = Literal["auto", "embree", "embreex"]


class Hits(NamedTuple):
    """Closest hits of R rays."""

    distance: NDArray[np.float32]
    """(R,) m; inf where nothing was hit."""
    normal: NDArray[np.float32]
    """(R, 3) unit, map, on the side of the ray's origin; zero where nothing was hit."""
    instance: NDArray[np.int32]
    """(R,) -1 where nothing was hit."""
    material: NDArray[np.uint8]
    """(R,) `Material`."""


class Clearance(NamedTuple):
    """Nearest surface points to P points."""

    distance: NDArray[np.float64]
    """(P,) m; the reach where nothing is nearer."""
    nearest: NDArray[np.float64]
    """(P, 3) m, map; the point itself where nothing is nearer."""
    instance: NDArray[np.int32]
    """(P,) -1 where nothing is nearer."""


def _no_bodies() -> BodyTable:
    return BodyTable(
        scene=np.zeros(0, dtype=np.int64),
        radius=np.zeros(0),
        material=np.zeros((0, 1), dtype=np.uint8),
        start=np.zeros((0, 7)),
        end=np.zeros((0, 7)),
        crew=1,
        rotors=np.zeros((0, 0, 10)),
        turn=np.zeros((0, 0, 2)),
    )


class Scene:
    """Static world plus moving UAV bodies.

    backend: "embree" (an error where it is unavailable), "embreex" (the plain fallback) or "auto"
    (the first if possible, else the second with a warning). `threads` share batches above 5,000
    rays; results do not depend on their number, bit for bit.
    """

    def __init__(
        self,
        terrain: Terrain | None,
        forest: Forest | None,
        *,
        detail: DetailLevel = DetailLevel.SENSING,
        solids: Sequence[Solid] = (),
        backend: Backend = "auto",
        threads: int = 1,
    ) -> None:
        self.workers = Workers(threads)
        self.solids = tuple(solids)
        self._content = collect(terrain, forest, detail, self.solids)
        self.backend: EmbreeBackend | EmbreexBackend = _make_backend(self._content, backend)
        self._bodies = _no_bodies()
        self._rotors = self._bodies.rotors
        self._is_twin = False

    @property
    def moving_offset(self) -> int:
        """Instance number of the first UAV's body."""
        return self._content.instances

    @property
    def compiled(self) -> bool:
        """Whether kernels can cast in this scene through `handle`."""
        return isinstance(self.backend, EmbreeBackend)

    @property
    def handle(self) -> SceneHandle:
        """What compiled kernels need to cast in this scene; only while the scene is open."""
        return self.backend.handle(self._bodies)

    def handle_with_blades(
        self, start: NDArray[np.float64], end: NDArray[np.float64]
    ) -> SceneHandle:
        """A handle whose rays see the blades of turning rotors instead of discs.

        start, end: (N, R or more) rad, how far each has turned at either end of the interval.
        """
        count, most, _ = self._rotors.shape
        turn = np.ascontiguousarray(np.stack([start[:count, :most], end[:count, :most]], axis=-1))
        return self.backend.handle(self._bodies._replace(rotors=self._rotors, turn=turn))

    def twin(self) -> Scene:
        """The same static world with moving bodies of its own, for another thread.

        It lives as long as this scene, and casts on the thread that asks.
        """
        twin = copy.copy(self)
        twin.workers = Workers(1)
        twin._bodies = _no_bodies()
        twin._rotors = twin._bodies.rotors
        twin._is_twin = True
        return twin

    def close(self) -> None:
        """Give memory and threads back; the scene must not be asked anything afterwards."""
        self.workers.close()
        if not self._is_twin:
            self.backend.close()

    def instance_name(self, instance: int) -> str:
        """What an instance number stands for: "ground", "tree 17", a solid's name, "uav3"."""
        if instance < 0:
            return "nothing"
        if instance == 0:
            return "ground"
        if instance <= self._content.trees:
            return f"tree {instance}"
        if instance < self.moving_offset:
            return self.solids[instance - 1 - self._content.trees].name
        return f"uav{instance - self.moving_offset + 1}"

    def set_bodies(
        self, shapes: Sequence[BodyShape], shape_index: ArrayLike, *, copies: int = 1
    ) -> None:
        """Make one moving body for each entry of `shape_index` (N,); place them with move_bodies.

        Until then they are far below the map. `copies`: of how many independent copies of a
        scenario they are, one copy after the other; a UAV's rays see its own copy alone.
        """
        index = np.asarray(shape_index, dtype=np.int64).reshape(-1)
        if index.size and (index.min() < 0 or index.max() >= len(shapes)):
            raise ValueError(f"shape_index must be in 0..{len(shapes) - 1}")
        parts = max((len(shape.parts) for shape in shapes), default=1)
        materials = np.zeros((len(shapes), parts), dtype=np.uint8)
        for i, shape in enumerate(shapes):
            for k, (_, material) in enumerate(shape.parts):
                materials[i, k] = Material(material)
        pose = np.tile([0.0, 0.0, -1e6, 0.0, 0.0, 0.0, 1.0], (len(index), 1))
        self._bodies = BodyTable(
            scene=self.backend.shape_scenes(shapes)[index],
            radius=np.array([shape.radius for shape in shapes])[index],
            material=np.ascontiguousarray(materials[index]),
            start=pose,
            end=pose.copy(),
            crew=max(len(index) // copies, 1),
            rotors=np.zeros((len(index), 0, 10)),
            turn=np.zeros((len(index), 0, 2)),
        )
        self._rotors = rotor_table(shapes)[index]

    def move_bodies(
        self,
        position: ArrayLike,
        attitude: ArrayLike,
        end_position: ArrayLike | None = None,
        end_attitude: ArrayLike | None = None,
    ) -> None:
        """Place the bodies: position (N, 3) m, attitude (N, 4) map from body.

        With a second pose the bodies move from the first to it, and a ray sees them at its own
        fraction of that interval.
        """
        bodies = self._bodies
        bodies.start[:, :3] = position
        bodies.start[:, 3:] = attitude
        bodies.end[:, :3] = position if end_position is None else end_position
        bodies.end[:, 3:] = attitude if end_attitude is None else end_attitude

    def cast(
        self,
        origins: ArrayLike,
        directions: ArrayLike,
        reach_m: float,
        exclude: int | ArrayLike = -1,
        *,
        fraction: float = 1.0,
        out: Hits | None = None,
    ) -> Hits:
        """Closest hits of rays: origins (R, 3) m, unit directions (R, 3), map.

        exclude: row of the UAV whose own body the rays do not see, or one a ray (R,); -1: none.
        fraction: where in their interval of motion the bodies are seen; 1 is the newest pose.
        out: an earlier result for as many rays, whose memory is used again; large batches gain.
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
            float(reach_m),
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
        """Whether anything lies between origins (R, 3) and targets (R, 3), m, map: (R,).

        The last .1 mm before the target do not count, so a surface does not hide its own points.
        """
        o, t = _ray_arrays(origins, targets, "targets")
        result = np.empty(len(o), dtype=np.bool_)
        self.backend.occluded(
            self.handle, self.workers, o, t, _rows(exclude, len(o)), float(fraction), result
        )
        return result

    def clearance(
        self, points: ArrayLike, reach_m: float, include_terrain: bool = True
    ) -> Clearance:
        """Nearest point of the static world (trees, solids, ground) to points (P, 3), m, map."""
        p = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
        if not np.isfinite(p).all():
            raise ValueError("points must be finite")
        if not reach_m >= 0.0:
            raise ValueError(f"reach_m must not be negative, not {reach_m}")
        result = Clearance(
            np.empty(len(p)), np.empty((len(p), 3)), np.empty(len(p), dtype=np.int32)
        )
        self.backend.clearance(p, float(reach_m), include_terrain, result)
        return result


def _new_hits(count: int) -> Hits:
    return Hits(
        np.empty(count, np.float32),
        np.empty((count, 3), np.float32),
        np.empty(count, np.int32),
        np.empty(count, np.uint8),
    )


def _make_backend(content: SceneContent, backend: Backend) -> EmbreeBackend | EmbreexBackend:
    if backend == "embreex":
        return EmbreexBackend(content)
    try:
        return EmbreeBackend(content)
    except EmbreeUnavailableError as error:
        if backend == "embree":
            raise
        warnings.warn(
            f"casting rays through embreex's slow public call, because {error}",
            RuntimeWarning,
            stacklevel=3,
        )
        return EmbreexBackend(content)


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
