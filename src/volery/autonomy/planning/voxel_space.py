"""A voxel map as a planning space: ground height, and distances to obstacles above it.

A state is (x, y, h) with h above the ground of its column. Unknown space is free: the local planner
observes it before the UAV enters it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.mapping.octomap_stream import Voxels
from volery.autonomy.planning.distances import squared_distances
from volery.core.arrays import Array
from volery.core.compiled import inline_kernel, kernel
from volery.core.errors import PlanError

Floats = NDArray[np.float32]
Integers = NDArray[np.int32]

_GROUND_M = 2.0
"""Width of the columns whose lowest occupied point is the ground."""
_ABOVE_M = 7.0
"""Height above ground up to which obstacles are stored."""
_TRUNK_FOOT_M = 0.8
"""Height above the lowest point of a column below which occupied cells are ground or growth."""
_MAX_COLUMNS = 2_000_000
_FAR_CELLS = 5


class SolidVoxels(NamedTuple):
    """Occupied cubes of a map, m."""

    middle: Array
    """(K, 3): centres."""
    side: Array
    """(K,): edge lengths."""

    @classmethod
    def of(cls, voxels: Voxels, resolution_m: float) -> SolidVoxels:
        """Returns the occupied cubes of a map."""
        side = voxels.side[voxels.occupied].astype(np.float64) * resolution_m
        corner = voxels.corner[voxels.occupied] * resolution_m
        return cls(corner + 0.5 * side[:, None], side)

    def is_near(self, around: Array, margin_m: float) -> bool:
        """Returns whether a cube lies within `margin_m` of the box of positions (K, 2+)."""
        low, high = around[:, :2].min(axis=0) - margin_m, around[:, :2].max(axis=0) + margin_m
        return bool(((self.middle[:, :2] >= low) & (self.middle[:, :2] <= high)).all(axis=1).any())


class VoxelSpace:
    """Distances to obstacles over the ground, up to five cells, on cells of `cell_m`."""

    def __init__(
        self, solid: SolidVoxels, cell_m: float, around: Array, margin_m: float = 25.0
    ) -> None:
        """Covers the positions `around`, (K, 2+) m, and `margin_m` around them.

        Raises PlanError if the space would be too large, or if the map holds nothing there.
        """
        self.cell_m = cell_m
        low = around[:, :2].min(axis=0) - margin_m
        high = around[:, :2].max(axis=0) + margin_m
        self._low = np.floor(low / _GROUND_M) * _GROUND_M
        shape = np.ceil((high - self._low) / _GROUND_M).astype(np.int64)
        if int(shape.prod()) * (_GROUND_M / cell_m) ** 2 > _MAX_COLUMNS:
            raise PlanError(
                f"start and goal span {shape[0] * _GROUND_M:g} m x {shape[1] * _GROUND_M:g} m: "
                "too far apart to plan a path"
            )
        near = ((solid.middle[:, :2] >= self._low) & (solid.middle[:, :2] <= high)).all(axis=1)
        if not near.any():
            raise PlanError("the map is empty between start and goal")
        middle, side = solid.middle[near], solid.side[near]
        lowest = middle - np.stack([0.0 * side, 0.0 * side, 0.5 * (side - side.min())], -1)
        self.ground = _ground(lowest, self._low, shape)
        cells = np.ceil(shape * _GROUND_M / cell_m).astype(np.int64)
        levels = math.ceil(_ABOVE_M / cell_m)
        occupied = np.zeros((*cells, levels), np.bool_)
        _mark(middle, side, self.ground, self._low, cell_m, occupied)
        square = squared_distances(occupied, _FAR_CELLS)
        self._distance: Floats = (np.sqrt(square) * cell_m).astype(np.float32)

    def box(self) -> list[tuple[float, float]]:
        """Returns (min, max) of x and of y, m."""
        high = self._low + np.array(self._distance.shape[:2]) * self.cell_m
        return [(float(self._low[axis]), float(high[axis])) for axis in range(2)]

    def ground_at(self, xy: Array) -> float:
        """Returns the ground height (m) at a position (2,), clamped to the map."""
        at = (xy - self._low) / _GROUND_M - 0.5
        limit = np.array(self.ground.shape) - 1
        first = np.clip(np.floor(at).astype(np.int64), 0, np.maximum(limit - 1, 0))
        fraction = np.clip(at - first, 0.0, 1.0)
        i, j = first.tolist()
        a, b = min(i + 1, int(limit[0])), min(j + 1, int(limit[1]))
        along = (1 - fraction[0]) * self.ground[i, [j, b]] + fraction[0] * self.ground[a, [j, b]]
        return float((1 - fraction[1]) * along[0] + fraction[1] * along[1])

    def is_free(self, x: float, y: float, h: float, radius_m: float) -> bool:
        """Returns whether a state is at least `radius_m` from obstacles."""
        return bool(
            _distance_at(x, y, h, self._low[0], self._low[1], self.cell_m, self._distance)
            >= radius_m
        )

    def is_free_leg(
        self, ax: float, ay: float, ah: float, bx: float, by: float, bh: float, radius_m: float
    ) -> bool:
        """Returns whether all states between two are at least `radius_m` from obstacles."""
        return bool(
            _leg(
                ax, ay, ah, bx, by, bh, radius_m, self._low[0], self._low[1], self.cell_m,
                self._distance,
            )
        )  # fmt: skip

    def is_free_between(self, a: Array, b: Array, radius_m: float) -> bool:
        """Returns `is_free_leg` for states (3,)."""
        ax, ay, ah = a.tolist()
        bx, by, bh = b.tolist()
        return self.is_free_leg(ax, ay, ah, bx, by, bh, radius_m)

    def free_near(self, position: Array, radius_m: float, search_m: float = 3.0) -> Array | None:
        """Returns the nearest free state (3,) within `search_m`, at the same height; else None.

        It searches along rings, a cell apart.
        """
        for ring in np.arange(0.0, search_m + 1e-9, self.cell_m):
            count = max(1, math.ceil(2.0 * math.pi * ring / self.cell_m))
            for angle in np.arange(count) * (2.0 * math.pi / count):
                x, y = position[0] + ring * math.cos(angle), position[1] + ring * math.sin(angle)
                if self.is_free(float(x), float(y), float(position[2]), radius_m):
                    return np.array([x, y, position[2]])
        return None


def _ground(middle: Array, low: Array, shape: NDArray[np.int64]) -> Array:
    """Returns each column's lowest occupied point, smoothed; empty columns interpolate."""
    ground = np.full(tuple(shape), np.inf)
    cells = np.floor((middle[:, :2] - low) / _GROUND_M).astype(np.int64)
    inside = ((cells >= 0) & (cells < shape)).all(axis=1)
    np.minimum.at(ground, tuple(cells[inside].T), middle[inside, 2])
    if not np.isfinite(ground).any():
        raise PlanError("the map holds no ground")
    while not np.isfinite(ground).all():
        around = _neighbours(ground)
        found = np.isfinite(around)
        mean = np.where(found, around, 0.0).sum(axis=0) / np.maximum(found.sum(axis=0), 1)
        grown = np.where(np.isfinite(ground), ground, np.where(found.any(axis=0), mean, np.inf))
        ground = grown
    # A column whose lowest point is a crown is an outlier; the median of nine removes it.
    return np.asarray(np.median(np.concatenate([ground[None], _neighbours(ground)]), axis=0))


def _neighbours(ground: Array) -> Array:
    """Returns the eight neighbours (8, nx, ny) of each column; the border is repeated."""
    wide = np.pad(ground, 1, mode="edge")
    nx, ny = ground.shape
    steps = [(a, b) for a in range(3) for b in range(3) if (a, b) != (1, 1)]
    return np.stack([wide[a : a + nx, b : b + ny] for a, b in steps])


@kernel
def _mark(
    middle: Array, side: Array, ground: Array, low: Array, cell: float, occupied: NDArray[np.bool_]
) -> None:
    nx, ny, nz = occupied.shape
    for v in range(len(side)):
        half = 0.5 * side[v]
        gi = min(max(int((middle[v, 0] - low[0]) / _GROUND_M), 0), ground.shape[0] - 1)
        gj = min(max(int((middle[v, 1] - low[1]) / _GROUND_M), 0), ground.shape[1] - 1)
        above = middle[v, 2] - ground[gi, gj]
        if above + half < _TRUNK_FOOT_M:
            continue
        for i in range(
            max(math.floor((middle[v, 0] - half - low[0] + 1e-6) / cell), 0),
            min(math.floor((middle[v, 0] + half - low[0] - 1e-6) / cell) + 1, nx),
        ):
            for j in range(
                max(math.floor((middle[v, 1] - half - low[1] + 1e-6) / cell), 0),
                min(math.floor((middle[v, 1] + half - low[1] - 1e-6) / cell) + 1, ny),
            ):
                for k in range(
                    max(math.floor((above - half + 1e-6) / cell), 0),
                    min(math.floor((above + half - 1e-6) / cell) + 1, nz),
                ):
                    occupied[i, j, k] = True


@inline_kernel
def _distance_at(
    x: float, y: float, h: float, low_x: float, low_y: float, cell: float, distance: Floats
) -> float:
    """Returns the distance (m) of the cell that holds a state; 0 outside."""
    i, j = math.floor((x - low_x) / cell), math.floor((y - low_y) / cell)
    k = math.floor(h / cell)
    nx, ny, nz = distance.shape
    if not (0 <= i < nx and 0 <= j < ny and 0 <= k < nz):
        return 0.0
    return float(distance[i, j, k])


@kernel
def _leg(
    ax: float,
    ay: float,
    ah: float,
    bx: float,
    by: float,
    bh: float,
    radius: float,
    low_x: float,
    low_y: float,
    cell: float,
    distance: Floats,
) -> bool:
    length = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2 + (bh - ah) ** 2)
    steps = max(1, math.ceil(2.0 * length / cell))
    for step in range(steps + 1):
        fraction = step / steps
        x, y, h = ax + fraction * (bx - ax), ay + fraction * (by - ay), ah + fraction * (bh - ah)
        if _distance_at(x, y, h, low_x, low_y, cell, distance) < radius:
            return False
    return True
