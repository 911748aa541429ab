"""Free and occupied cells at flight height, as a grid seen from above.

A slab parallel to the ground through the vehicle: a ray inside of it frees cells, a hit inside of
it occupies its cell. Cells count the scans with hits against those with passing rays; within one
scan a hit outweighs all rays that pass its cell, so that thin trunks remain.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.scan_rays import Rays
from volery.core.arrays import Array
from volery.core.compiled import kernel
from volery.core.saved_state import SavedAttributes

Scores = NDArray[np.int8]

UNKNOWN = -128
_HIT, _MISS, _MIN_SCORE, _MAX_SCORE = 3, 1, -6, 12
"""Score of a scan's hit and miss, and bounds: a trunk that moved away is cleared after 12 scans
(modelling choices).
"""


class HeightSlab(NamedTuple):
    """Heights z = height + slope . (x, y) within `half_m`."""

    height: float
    slope: Array
    half_m: float


class ProjectedGrid(SavedAttributes):
    """A square grid of bounded extent around its initial position."""

    STATE = ("score", "_scan", "_number", "origin", "outside")

    def __init__(self, cell_m: float, extent_m: float) -> None:
        self.cell_m = cell_m
        cells = math.ceil(extent_m / cell_m)
        self.score: Scores = np.full((cells, cells), UNKNOWN, np.int8)
        """Rows along y, columns along x; above 0 is occupied."""
        self._scan = np.zeros((cells, cells), np.int32)
        self._number = 0
        self.origin: NDArray[np.int64] | None = None
        """Column and row of the lower left cell, counted from the map's origin."""
        self.outside = 0
        """Number of hits beyond the grid."""

    def begin_at(self, position: Array) -> None:
        """Centres the grid on `position` (2+,) m, if it has no position yet."""
        if self.origin is None:
            middle = np.floor(position[:2] / self.cell_m).astype(np.int64)
            self.origin = middle - len(self.score) // 2

    def add(self, rays: Rays, slab: HeightSlab) -> None:
        """Adds the rays of one scan, m in the map."""
        assert self.origin is not None
        self._number += 2
        self.outside += _draw(
            rays.starts,
            rays.ends,
            rays.hits,
            slab.height,
            slab.slope,
            slab.half_m,
            self.cell_m,
            self.origin,
            self._number,
            self.score,
            self._scan,
        )

    def known_box(self) -> tuple[slice, slice] | None:
        """Returns rows and columns that contain all known cells; None for an empty grid."""
        known = self.score != UNKNOWN
        rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
        if len(rows) == 0:
            return None
        return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def occupancy(score: Scores) -> NDArray[np.int8]:
    """Returns values of nav_msgs/OccupancyGrid: -1 unknown, 0 free, 100 occupied."""
    values = np.where(score > 0, np.int8(100), np.int8(0))
    values[score == UNKNOWN] = -1
    return values


@kernel
def _draw(
    starts: Array,
    ends: Array,
    hits: NDArray[np.bool_],
    height: float,
    slope: Array,
    half: float,
    cell: float,
    origin: NDArray[np.int64],
    number: int,
    score: Scores,
    scan: NDArray[np.int32],
) -> int:
    """Adds hits first, stamped with `number`, then misses, with `number` - 1, once per cell."""
    rows, columns = score.shape
    outside = 0
    for k in range(len(hits)):
        if not hits[k]:
            continue
        x, y = ends[k, 0], ends[k, 1]
        if abs(ends[k, 2] - height - slope[0] * x - slope[1] * y) > half:
            continue
        i, j = math.floor(y / cell) - origin[1], math.floor(x / cell) - origin[0]
        if not (0 <= i < rows and 0 <= j < columns):
            outside += 1
        elif scan[i, j] != number:
            scan[i, j] = number
            before = 0 if score[i, j] == UNKNOWN else score[i, j]
            score[i, j] = min(before + _HIT, _MAX_SCORE)
    for k in range(len(hits)):
        x, y, z = starts[k, 0], starts[k, 1], starts[k, 2]
        dx, dy, dz = ends[k, 0] - x, ends[k, 1] - y, ends[k, 2] - z
        steps = math.ceil(2.0 * max(abs(dx), abs(dy)) / cell)
        if steps == 0:
            continue
        for step in range(steps + (0 if hits[k] else 1)):
            fraction = step / steps
            px, py = x + fraction * dx, y + fraction * dy
            if abs(z + fraction * dz - height - slope[0] * px - slope[1] * py) > half:
                if step > 0:
                    break  # a straight ray that has left the slab does not return
                continue
            i, j = math.floor(py / cell) - origin[1], math.floor(px / cell) - origin[0]
            if not (0 <= i < rows and 0 <= j < columns):
                break
            if scan[i, j] < number - 1:
                scan[i, j] = number - 1
                before = 0 if score[i, j] == UNKNOWN else score[i, j]
                score[i, j] = max(before - _MISS, _MIN_SCORE)
    return outside
