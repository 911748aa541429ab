"""A map of walls: cells with the shape of their returns, and a field of proximity to them.

Cells of `CELL_M` that hold returns are numbered; the grid holds the numbers. A cell holds the mean
of its returns and, from those around it, whether they lie along a line.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel

Grid = NDArray[np.int32]
Field = NDArray[np.uint8]

CELL_M = 0.1
COUNT, MX, MY, CXX, CXY, CYY = range(6)
"""Columns of sums: number, mean and sums of squares about it."""
RX, RY, NX, NY, THICK, KIND = range(6)
"""Columns of shapes: a point, the line's normal, its variance across, and the kind."""
LINE, HEAP, FEW = 1.0, 0.0, -1.0
"""Kinds; FEW: too few returns to classify. Far along a wall single beams always end at the same
positions relative to the scanner: taken for objects they would hold it in place.
"""
FULL = 100
"""Value of the field on a wall."""
_MIN_RETURNS = 5.0
"""Min number of returns of a line."""
_STRAIGHT, _VERY_STRAIGHT = 0.12, 0.04
"""Max variance across over that along, of a line in a window of three cells, and of five."""
_ALONG_M = 0.05
_BLUR_M = 0.1


@inner_kernel
def _take_in(sums: Array, x: float, y: float) -> None:
    sums[COUNT] += 1.0
    dx, dy = x - sums[MX], y - sums[MY]
    sums[MX] += dx / sums[COUNT]
    sums[MY] += dy / sums[COUNT]
    sums[CXX] += dx * (x - sums[MX])
    sums[CXY] += dx * (y - sums[MY])
    sums[CYY] += dy * (y - sums[MY])


@inner_kernel
def _join(total: Array, part: Array) -> None:
    both = total[COUNT] + part[COUNT]
    dx, dy = part[MX] - total[MX], part[MY] - total[MY]
    weight = total[COUNT] * part[COUNT] / both
    total[CXX] += part[CXX] + weight * dx * dx
    total[CXY] += part[CXY] + weight * dx * dy
    total[CYY] += part[CYY] + weight * dy * dy
    total[MX] += dx * part[COUNT] / both
    total[MY] += dy * part[COUNT] / both
    total[COUNT] = both


@inner_kernel
def _window(grid: Grid, sums: Array, i: int, j: int, radius: int, total: Array) -> None:
    n = grid.shape[0]
    total[:] = 0.0
    for a in range(max(i - radius, 0), min(i + radius + 1, n)):
        for b in range(max(j - radius, 0), min(j + radius + 1, n)):
            if grid[a, b] >= 0:
                _join(total, sums[grid[a, b]])


@inner_kernel
def _shape(total: Array, shape: Array, straight: float) -> bool:
    """Describes the returns of a window; returns whether they lie along a line."""
    n = total[COUNT]
    a, b, d = total[CXX] / n, total[CXY] / n, total[CYY] / n
    middle, half = 0.5 * (a + d), math.hypot(0.5 * (a - d), b)
    low, high = max(middle - half, 0.0), middle + half
    shape[RX], shape[RY] = total[MX], total[MY]
    if n < _MIN_RETURNS or high < _ALONG_M * _ALONG_M or low > straight * high:
        return False
    angle = 0.5 * math.atan2(2.0 * b, a - d) + 0.5 * math.pi
    shape[NX], shape[NY] = math.cos(angle), math.sin(angle)
    shape[THICK], shape[KIND] = low, LINE
    return True


@kernel
def build(points: Array, corner: Array, grid: Grid, cells: Grid, sums: Array, shapes: Array) -> int:
    """Fills a map with points (K, 2); returns the number of cells.

    `corner` (2,) m is that of the grid.
    """
    n, count, max_cells = grid.shape[0], 0, sums.shape[0]
    grid[:] = -1
    for k in range(points.shape[0]):
        i = math.floor((points[k, 0] - corner[0]) / CELL_M)
        j = math.floor((points[k, 1] - corner[1]) / CELL_M)
        if not (0 <= i < n and 0 <= j < n):
            continue
        if grid[i, j] < 0:
            if count == max_cells:
                continue
            grid[i, j] = count
            cells[count, 0], cells[count, 1] = i, j
            sums[count] = 0.0
            count += 1
        _take_in(sums[grid[i, j]], points[k, 0], points[k, 1])
    total = np.zeros(6)
    for k in range(count):
        i, j = cells[k, 0], cells[k, 1]
        _window(grid, sums, i, j, 2, total)
        sparse = total[COUNT] < 3.0 * _MIN_RETURNS
        if _shape(total, shapes[k], _STRAIGHT if sparse else _VERY_STRAIGHT):
            continue
        is_known = total[COUNT] >= _MIN_RETURNS
        _window(grid, sums, i, j, 1, total)
        if not _shape(total, shapes[k], _STRAIGHT):
            own = sums[k]
            shapes[k, RX], shapes[k, RY] = own[MX], own[MY]
            shapes[k, NX], shapes[k, NY] = 1.0, 0.0
            shapes[k, THICK] = 0.25 * CELL_M * CELL_M
            shapes[k, KIND] = HEAP if is_known else FEW
    return count


@kernel
def blur(
    cells: Grid, sums: Array, count: int, corner: Array, min_count: float, field: Field
) -> None:
    """Fills `field` with the proximity to walls: `FULL` at a wall, falling as a normal density.

    Cells with fewer than `min_count` returns do not count.
    """
    n = field.shape[0]
    field[:] = 0
    for k in range(count):
        if sums[k, COUNT] < min_count:
            continue
        for a in range(max(cells[k, 0] - 2, 0), min(cells[k, 0] + 3, n)):
            for b in range(max(cells[k, 1] - 2, 0), min(cells[k, 1] + 3, n)):
                dx = corner[0] + (a + 0.5) * CELL_M - sums[k, MX]
                dy = corner[1] + (b + 0.5) * CELL_M - sums[k, MY]
                near = math.exp(-0.5 * (dx * dx + dy * dy) / (_BLUR_M * _BLUR_M))
                field[a, b] = max(field[a, b], round(FULL * near))


@kernel
def pool(fields: Field) -> None:
    """Fills `fields` (L, n, n) from the first: level h holds maxima of 2^h x 2^h cells."""
    levels, n = fields.shape[0], fields.shape[1]
    for h in range(1, levels):
        step = 1 << (h - 1)
        low, high = fields[h - 1], fields[h]
        for i in range(n):
            below = min(i + step, n - 1)
            for j in range(n - step):
                one = max(low[i, j], low[i, j + step])
                other = max(low[below, j], low[below, j + step])
                high[i, j] = max(one, other)
            for j in range(n - step, n):
                high[i, j] = max(low[i, j], low[below, j])
