"""Local occupancy grid around a moving vehicle: cells are free, occupied or unknown, from rays.

Cells wrap around, so that the grid follows the vehicle without copying. Within one scan a hit
outweighs all rays that pass its cell, so that trunks thinner than a cell remain.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.scan_rays import Rays
from volery.core.arrays import Array
from volery.core.compiled import kernel
from volery.core.saved_state import SavedAttributes

Integers = NDArray[np.int64]
Scores = NDArray[np.int8]

UNKNOWN = -128
_HIT, _MISS, _MIN_SCORE, _MAX_SCORE = 4, 1, -3, 12
"""Score of a scan's hit and miss, and bounds (modelling choices): an obstacle that moves away is
cleared after 12 scans that pass through it.
"""


class LocalGrid(SavedAttributes):
    """Holds `shape` cells of `cell_m` around the vehicle; above 0: occupied, `UNKNOWN`: unknown."""

    STATE = ("_score", "_scan", "_number", "_low")

    def __init__(self, cell_m: float, shape: tuple[int, int, int]) -> None:
        self.cell_m = cell_m
        self._score: Scores = np.full(shape, UNKNOWN, np.int8)
        self._scan = np.zeros(shape, np.int32)
        self._number = 0
        self._low: Integers | None = None
        """Index of the lowest cell (3,), counted from the frame's origin."""

    def move_to(self, position: Array) -> None:
        """Centres the grid on `position` (3,) m; cells that enter it are unknown."""
        shape = np.array(self._score.shape)
        low = np.floor(position / self.cell_m).astype(np.int64) - shape // 2
        if self._low is None:
            self._low = low
            return
        for axis in range(3):
            step = int(low[axis] - self._low[axis])
            size = int(shape[axis])
            if step == 0:
                continue
            if abs(step) >= size:
                self._score[:] = UNKNOWN
                break
            first = int(self._low[axis]) if step > 0 else int(low[axis])
            entering = np.arange(first, first + abs(step)) % size
            index: list[Any] = [slice(None)] * 3
            index[axis] = entering
            self._score[tuple(index)] = UNKNOWN
        self._low = low

    def add(self, rays: Rays, *, clears: bool = True) -> None:
        """Adds the rays of one scan; `clears`: they also clear the cells that they pass."""
        assert self._low is not None
        self._number += 2
        ends, number = rays.ends / self.cell_m, self._number
        _mark(ends, rays.hits, self._low, number, self._score, self._scan)
        if clears:
            starts = rays.starts / self.cell_m
            _cast(starts, ends, self._low, number, self._score, self._scan)

    def clear_around(self, position: Array, radius_m: float) -> None:
        """Marks unknown cells around the vehicle, at `position` (3,) m, as free."""
        assert self._low is not None
        _clear(position / self.cell_m, radius_m / self.cell_m, self._low, self._score)

    def window(self, position: Array, shape: tuple[int, int, int]) -> tuple[Scores, Integers]:
        """Returns the scores of the cells around `position`, and the lowest cell's index (3,)."""
        assert self._low is not None
        low = np.floor(position / self.cell_m).astype(np.int64) - np.array(shape) // 2
        low = np.clip(low, self._low, self._low + np.array(self._score.shape) - shape)
        scores = np.empty(shape, np.int8)
        _copy(self._score, low, scores)
        return scores, low


@kernel
def _copy(score: Scores, low: Integers, out: Scores) -> None:
    nx, ny, nz = score.shape
    first = low[2] % nz
    until = min(out.shape[2], nz - first)
    for i in range(out.shape[0]):
        a = (low[0] + i) % nx
        for j in range(out.shape[1]):
            b = (low[1] + j) % ny
            for k in range(until):
                out[i, j, k] = score[a, b, first + k]
            for k in range(until, out.shape[2]):
                out[i, j, k] = score[a, b, first + k - nz]


@kernel
def _mark(
    ends: Array,
    hits: NDArray[np.bool_],
    low: Integers,
    number: int,
    score: Scores,
    scan: NDArray[np.int32],
) -> None:
    """Marks the ends (K, 3) of rays that hit something, in cells."""
    nx, ny, nz = score.shape
    for k in range(len(hits)):
        if not hits[k]:
            continue
        a, b, c = math.floor(ends[k, 0]), math.floor(ends[k, 1]), math.floor(ends[k, 2])
        inside = 0 <= a - low[0] < nx and 0 <= b - low[1] < ny and 0 <= c - low[2] < nz
        i, j, m = a % nx, b % ny, c % nz
        if inside and scan[i, j, m] != number:
            scan[i, j, m] = number
            before = 0 if score[i, j, m] == UNKNOWN else score[i, j, m]
            score[i, j, m] = min(before + _HIT, _MAX_SCORE)


@kernel
def _cast(
    starts: Array,
    ends: Array,
    low: Integers,
    number: int,
    score: Scores,
    scan: NDArray[np.int32],
) -> None:
    """Clears the cells along rays, in cells, after Amanatides and Woo (Eurographics 1987)."""
    nx, ny, nz = score.shape
    for k in range(len(starts)):
        x, y, z = starts[k, 0], starts[k, 1], starts[k, 2]
        dx, dy, dz = ends[k, 0] - x, ends[k, 1] - y, ends[k, 2] - z
        a, b, c = math.floor(x), math.floor(y), math.floor(z)
        sa, sb, sc = (1 if dx > 0 else -1), (1 if dy > 0 else -1), (1 if dz > 0 else -1)
        ta = (a + (1 if dx > 0 else 0) - x) / dx if dx != 0.0 else math.inf
        tb = (b + (1 if dy > 0 else 0) - y) / dy if dy != 0.0 else math.inf
        tc = (c + (1 if dz > 0 else 0) - z) / dz if dz != 0.0 else math.inf
        wa = abs(1.0 / dx) if dx != 0.0 else math.inf
        wb = abs(1.0 / dy) if dy != 0.0 else math.inf
        wc = abs(1.0 / dz) if dz != 0.0 else math.inf
        while 0 <= a - low[0] < nx and 0 <= b - low[1] < ny and 0 <= c - low[2] < nz:
            i, j, m = a % nx, b % ny, c % nz
            if scan[i, j, m] < number - 1:
                scan[i, j, m] = number - 1
                before = 0 if score[i, j, m] == UNKNOWN else score[i, j, m]
                score[i, j, m] = max(before - _MISS, _MIN_SCORE)
            if ta <= tb and ta <= tc:
                if ta > 1.0:
                    break
                a, ta = a + sa, ta + wa
            elif tb <= tc:
                if tb > 1.0:
                    break
                b, tb = b + sb, tb + wb
            else:
                if tc > 1.0:
                    break
                c, tc = c + sc, tc + wc


@kernel
def _clear(position: Array, radius: float, low: Integers, score: Scores) -> None:
    nx, ny, nz = score.shape
    radius_cells = math.ceil(radius)
    for a in range(
        math.floor(position[0]) - radius_cells, math.floor(position[0]) + radius_cells + 1
    ):
        for b in range(
            math.floor(position[1]) - radius_cells, math.floor(position[1]) + radius_cells + 1
        ):
            for c in range(
                math.floor(position[2]) - radius_cells, math.floor(position[2]) + radius_cells + 1
            ):
                dx, dy, dz = a + 0.5 - position[0], b + 0.5 - position[1], c + 0.5 - position[2]
                inside = 0 <= a - low[0] < nx and 0 <= b - low[1] < ny and 0 <= c - low[2] < nz
                i, j, m = a % nx, b % ny, c % nz
                near = dx * dx + dy * dy + dz * dz <= radius * radius
                if inside and near and score[i, j, m] == UNKNOWN:
                    score[i, j, m] = -1
