"""Finds the best pose of a scan in a window of a map, by branch and bound.

The correlative matching of E. Olson (Real-time correlative scan matching, ICRA 2009), searched as
by W. Hess et al. (Real-time loop closure in 2D LIDAR SLAM, ICRA 2016): a square of 2^h x 2^h cells
cannot score more than the maximum that each return finds in it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.planar.map_kernels import CELL_M, FULL, Field
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel

Cells = NDArray[np.int32]

_MAX_NODES = 400_000
"""Max number of squares, which bounds the time."""


@inner_kernel
def _score(field: Field, cells: Cells, i: int, j: int) -> float:
    """Returns the mean over points at cells (K, 2), shifted by (i, j), as a fraction."""
    n, total = field.shape[0], 0
    for k in range(cells.shape[0]):
        a, b = cells[k, 0] + i, cells[k, 1] + j
        # A square that only begins outside may extend inside.
        if -64 < a < n and -64 < b < n:
            total += field[max(a, 0), max(b, 0)]
    return float(total / (FULL * max(cells.shape[0], 1)))


@inner_kernel
def _turn(points: Array, yaw: float, middle: Array, corner: Array, cells: Cells) -> None:
    c, s = math.cos(yaw), math.sin(yaw)
    for k in range(points.shape[0]):
        x = middle[0] + c * points[k, 0] - s * points[k, 1] - corner[0]
        y = middle[1] + s * points[k, 0] + c * points[k, 1] - corner[1]
        cells[k, 0], cells[k, 1] = math.floor(x / CELL_M), math.floor(y / CELL_M)


@inner_kernel
def _put(node: Array, score: float, level: int, turn: int, i: int, j: int) -> None:
    node[0], node[1], node[2], node[3], node[4] = score, level, turn, i, j


@inner_kernel
def _split(fields: Field, cells: Cells, stack: Array, held: int, found: float) -> int:
    """Replaces the square at `held` by its four parts, best last; returns the new stack size."""
    level, turn = int(stack[held, 1]) - 1, int(stack[held, 2])
    i, j, begin = int(stack[held, 3]), int(stack[held, 4]), held
    half = 1 << level
    for part in range(4):
        a, b = i + half * (part // 2), j + half * (part % 2)
        score = _score(fields[level], cells[turn], a, b)
        if score <= found:
            continue
        at = held
        while at > begin and stack[at - 1, 0] > score:
            for n in range(5):
                stack[at, n] = stack[at - 1, n]
            at -= 1
        _put(stack[at], score, level, turn, a, b)
        held += 1
    return held


@inner_kernel
def _begin(fields: Field, cells: Cells, top: int, wide: int, high: int, first: Array) -> None:
    """Fills `first` (N, 5) with the squares of the highest level that cover the window."""
    side, row = 1 << top, 0
    for turn in range(cells.shape[0]):
        for i in range(-wide, wide + 1, side):
            for j in range(-high, high + 1, side):
                _put(first[row], _score(fields[top], cells[turn], i, j), top, turn, i, j)
                row += 1


@kernel
def search(
    points: Array,
    fields: Field,
    corner: Array,
    middle: Array,
    window: Array,
    step_rad: float,
    slope: Array,
    min_score: float,
    shut: Array,
    best: Array,
) -> float:
    """Finds the pose (3,) of points (K, 2) that scores best in `middle` (3,) +- `window` (3,).

    slope: (3,) reduction of the score for each unit squared away from `middle`. min_score: lower
    scores are ignored. shut: (3,) position x, y and a radius that are excluded. Returns the score,
    0 if none was found; else `best` is filled.
    """
    turns = math.ceil(window[2] / step_rad)
    wide, high = math.ceil(window[0] / CELL_M), math.ceil(window[1] / CELL_M)
    cells = np.empty((2 * turns + 1, points.shape[0], 2), np.int32)
    for t in range(2 * turns + 1):
        _turn(points, middle[2] + (t - turns) * step_rad, middle, corner, cells[t])
    top = fields.shape[0] - 1
    while top > 0 and (1 << top) > max(wide, high):
        top -= 1
    side = 1 << top
    count = (2 * turns + 1) * ((2 * wide) // side + 1) * ((2 * high) // side + 1)
    first, stack = np.empty((count, 5)), np.empty((4 * top + 8, 5))
    _begin(fields, cells, top, wide, high, first)
    found, looked = min_score, 0
    for k in np.argsort(-first[:, 0]):
        if first[k, 0] <= found or looked > _MAX_NODES:
            break
        for n in range(5):
            stack[0, n] = first[k, n]
        held = 1
        while held > 0:
            held -= 1
            score, i, j = stack[held, 0], int(stack[held, 3]), int(stack[held, 4])
            if score <= found:
                continue
            if stack[held, 1] > 0.0:
                looked += 4
                held = _split(fields, cells, stack, held, found)
                continue
            x, y, yaw = i * CELL_M, j * CELL_M, (stack[held, 2] - turns) * step_rad
            away = math.hypot(middle[0] + x - shut[0], middle[1] + y - shut[1])
            score -= slope[0] * x * x + slope[1] * y * y + slope[2] * yaw * yaw
            if score > found and away >= shut[2] and abs(i) <= wide and abs(j) <= high:
                found = score
                best[0], best[1], best[2] = middle[0] + x, middle[1] + y, middle[2] + yaw
    return found if found > min_score else 0.0
