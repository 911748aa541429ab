"""A map of uprights: Gaussians of their returns, as seen from above, in cells by height layers.

Trunks and walls are nearly vertical: the height at which a beam hits them matters little, and
layers separate leaning ones. Cells hold number, mean (from their centre) and covariance sums of
their returns (P. Biber and W. Strasser, The normal distributions transform, IROS 2003). The map
rolls, like the ground map.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.ground_kernels import Keys, key_of
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel

Cells = NDArray[np.float32]
CELL_M = 0.5
LAYER_M = 1.0
CELLS, LAYERS = 192, 16
MAX_RETURNS = 60.0
"""Returns of a cell after which its sums stay constant."""
MIN_RETURNS = 2.0
"""Min returns of a cell that counts."""


@inner_kernel
def add_upright(keys: Keys, cells: Cells, x: float, y: float, z: float) -> None:
    """Adds a return."""
    i, j, k = math.floor(x / CELL_M), math.floor(y / CELL_M), math.floor(z / LAYER_M)
    a, b, c, key = i % CELLS, j % CELLS, k % LAYERS, key_of(i, j, k)
    cell = cells[a, b, c]
    if keys[a, b, c] != key:
        keys[a, b, c] = key
        cell[:] = 0.0
    if cell[0] >= MAX_RETURNS:
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
    """Returns whether an upright lies within `gate` m; fills `found` (5,): x, y and covariance.

    The layer of the return comes first, then its neighbours, with 0.1 m more standard deviation.
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
                if keys[a, b, c] != key_of(i, j, k) or cells[a, b, c, 0] < MIN_RETURNS:
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
