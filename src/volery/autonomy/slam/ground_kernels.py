"""A ground map: sums of ground returns in cells of 1 m, and planes through neighbouring cells.

The map rolls: it is an array of `GROUND_CELLS` squared. Many cells of the world share one element;
the element belongs to the newest of them, identified by its key.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.compiled import inner_kernel

Keys = NDArray[np.int64]

GROUND_CELL_M = 1.0
GROUND_CELLS = 192
MAX_RETURNS = 40.0
"""Returns of a cell after which its sums stay constant."""
_RIDGE = 0.3
"""m^2: weight of the expected slope in a plane fit."""


@inner_kernel
def key_of(i: int, j: int, k: int) -> int:
    """Returns the key of a cell; indices beyond 2^20 would collide."""
    return ((i & 0x1FFFFF) << 42) | ((j & 0x1FFFFF) << 21) | (k & 0x1FFFFF)


@inner_kernel
def add_ground(keys: Keys, sums: Array, x: float, y: float, z: float) -> None:
    """Adds a return."""
    i, j = math.floor(x / GROUND_CELL_M), math.floor(y / GROUND_CELL_M)
    a, b, key = i % GROUND_CELLS, j % GROUND_CELLS, key_of(i, j, 0)
    cell = sums[a, b]
    if keys[a, b] != key:
        keys[a, b] = key
        cell[:] = 0.0
    if cell[0] >= MAX_RETURNS:
        return
    cell[0] += 1.0
    cell[1] += x
    cell[2] += y
    cell[3] += z
    cell[4] += x * x
    cell[5] += x * y
    cell[6] += y * y
    cell[7] += x * z
    cell[8] += y * z


@inner_kernel
def plane_at(
    keys: Keys, sums: Array, x: float, y: float, around: int, slope: Array, plane: Array
) -> int:
    """Fills `plane` (6,) from the cells around a position; returns the number of known cells.

    The plane holds the height at (x, y), its two slopes, and x, y, z of the centroid of the
    returns. Its slope is regularized towards `slope` (2,). It is not filled if no cell within
    `around` cells is known.
    """
    ci, cj = math.floor(x / GROUND_CELL_M), math.floor(y / GROUND_CELL_M)
    known, n = 0, 0.0
    sx = sy = sz = sxx = sxy = syy = sxz = syz = 0.0
    for i in range(ci - around, ci + around + 1):
        a = i % GROUND_CELLS
        for j in range(cj - around, cj + around + 1):
            b = j % GROUND_CELLS
            if keys[a, b] != key_of(i, j, 0):
                continue
            cell = sums[a, b]
            # Cells weigh equally, else the plane would follow the near ground, which is seen more
            # often.
            w = 1.0 / cell[0]
            known += 1
            n += 1.0
            sx += w * cell[1]
            sy += w * cell[2]
            sz += w * cell[3]
            sxx += w * cell[4]
            sxy += w * cell[5]
            syy += w * cell[6]
            sxz += w * cell[7]
            syz += w * cell[8]
    if known == 0:
        return 0
    mx, my, mz = sx / n, sy / n, sz / n
    cxx, cxy, cyy = sxx / n - mx * mx + _RIDGE, sxy / n - mx * my, syy / n - my * my + _RIDGE
    cxz = sxz / n - mx * mz + _RIDGE * slope[0]
    cyz = syz / n - my * mz + _RIDGE * slope[1]
    under = cxx * cyy - cxy * cxy
    plane[1] = (cyy * cxz - cxy * cyz) / under
    plane[2] = (cxx * cyz - cxy * cxz) / under
    plane[0] = mz + plane[1] * (x - mx) + plane[2] * (y - my)
    plane[3], plane[4], plane[5] = mx, my, mz
    return known
