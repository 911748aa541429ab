"""Distances to the nearest obstacle and known space around a vehicle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.planning.distances import Squares, squared_distances
from volery.autonomy.planning.local_grid import UNKNOWN, Scores
from volery.core.arrays import Array
from volery.core.compiled import kernel

FAR_CELLS = 7
"""Largest distance that is measured, cells."""


class Clearance(NamedTuple):
    """Distances to obstacles in a window of cells."""

    square: Squares
    """(nx, ny, nz): squared distance to the nearest occupied cell, in cells, at most 49."""
    known: NDArray[np.bool_]
    """(nx, ny, nz): whether a cell counts as observed."""
    low: NDArray[np.int64]
    """(3,): index of the lowest cell, counted from the frame's origin."""
    cell_m: float

    @property
    def far_m(self) -> float:
        """Returns the largest distance that is measured, m."""
        return FAR_CELLS * self.cell_m

    def at(self, positions: Array) -> Array:
        """Returns the distances (K,) m at positions (K, 3) m; 0 outside of the window."""
        cells = np.floor(positions / self.cell_m).astype(np.int64) - self.low
        inside = ((cells >= 0) & (cells < self.square.shape)).all(axis=1)
        cells[~inside] = 0
        found = np.sqrt(self.square[tuple(cells.T)].astype(np.float64)) * self.cell_m
        return np.where(inside, found, 0.0)


def clearance_of(
    scores: Scores, low: NDArray[np.int64], cell_m: float, upright_cells: int
) -> Clearance:
    """Returns the distances around a window of scores.

    A cell is known if one within `upright_cells` over or under it is. The nodding scan leaves gaps
    between its lines; this closes them, as obstacles in a forest are upright.
    """
    occupied, known = np.empty(scores.shape, np.bool_), np.empty(scores.shape, np.bool_)
    _know(scores, upright_cells, occupied, known)
    return Clearance(squared_distances(occupied, FAR_CELLS), known, low, cell_m)


@kernel
def _know(
    scores: Scores, upright: int, occupied: NDArray[np.bool_], known: NDArray[np.bool_]
) -> None:
    nx, ny, nz = scores.shape
    for i in range(nx):
        for j in range(ny):
            last = -upright - 1  # the last observed cell from below
            for k in range(nz):
                if scores[i, j, k] != UNKNOWN:
                    last = k
                occupied[i, j, k] = scores[i, j, k] > 0
                known[i, j, k] = k - last <= upright
            last = nz + upright
            for k in range(nz - 1, -1, -1):
                if scores[i, j, k] != UNKNOWN:
                    last = k
                known[i, j, k] |= last - k <= upright
