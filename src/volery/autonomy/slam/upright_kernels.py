"""A map of what stands: Gaussians of its returns, as seen from above, in cells by layers of height.

Trunks and walls are nearly upright: where a beam meets them, up or down, matters little, and what
bends is told apart by layers. Cells hold number, mean (from their middle) and covariance sums of
their returns (P. Biber and W. Strasser, The normal distributions transform, IROS 2003). As the
map of the ground it rolls.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.ground_kernels import Keys, key_of
from volery.core.compiled import inner_kernel

Cells = NDArray[np.float32]
Array = NDArray[np.float64]

CELL_M = 0.5
LAYER_M = 1.0
CELLS, LAYERS = 192, 16
MOST = 60.0
"""Returns of a cell after which it stays as it is."""
LEAST = 2.0
"""Returns of a cell before it counts."""


@inner_kernel
def add_upright(keys: Keys, cells: Cells, x: float, y: float, z: float) -> None:
    """Take in a return."""
    i, j, k = math.floor(x / CELL_M), math.floor(y / CELL_M), math.floor(z / LAYER_M)
    a, b, c, key = i % CELLS, j % CELLS, k % LAYERS, key_of(i, j, k)
    cell = cells[a, b, c]
    if keys[a, b, c] != key:
        keys[a, b, c] = key
        cell[:] = 0.0
    if cell[0] >= MOST:
        return
    cell[0] += 1.0
    fx, fy = x - (i + 0.5) * CELL_M, y - (j + 0.5) * CELL_M
    dx, dy = fx - cell[1], fy - cell[2]
    cell[1] += dx / cell[0]
    cell[2] += dy / cell[0]
    cell[3] += dx * (fx - cell[1])
    cell[4] += dx * (fy - cell[2])
    cell[5] += dy * (fy - cell[2])


@inner_kernel
def nearest_upright(
    keys: Keys, cells: Cells, x: float, y: float, z: float, gate: float, found: Array
) -> bool:
    """Whether something stands within `gate` m; fills `found` (5,): x, y and covariance.

    Of the layers that of the return counts, then those beside it, with 0.1 m more spread.
    """
    ci, cj, ck = math.floor(x / CELL_M), math.floor(y / CELL_M), math.floor(z / LAYER_M)
    beside = 1 if z / LAYER_M - ck >= 0.5 else -1
    for turn in range(3):
        k = ck if turn == 0 else (ck + beside if turn == 1 else ck - beside)
        c, best = k % LAYERS, gate * gate
        for i in range(ci - 1, ci + 2):
            a = i % CELLS
            for j in range(cj - 1, cj + 2):
                b = j % CELLS
                if keys[a, b, c] != key_of(i, j, k) or cells[a, b, c, 0] < LEAST:
                    continue
                cell = cells[a, b, c]
                mx, my = (i + 0.5) * CELL_M + cell[1], (j + 0.5) * CELL_M + cell[2]
                away = (mx - x) * (mx - x) + (my - y) * (my - y)
                if away < best:
                    best = away
                    found[0], found[1] = mx, my
                    extra = 0.0 if turn == 0 else 0.01
                    found[2] = cell[3] / cell[0] + extra
                    found[3] = cell[4] / cell[0]
                    found[4] = cell[5] / cell[0] + extra
        if best < gate * gate:
            return True
    return False
