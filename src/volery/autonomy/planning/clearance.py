"""How far it is to the next obstacle, and where something is known, around a vehicle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.planning.local_grid import UNKNOWN, Scores
from volery.core.compiled import kernel

Array = NDArray[np.float64]
Squares = NDArray[np.int16]

FAR_CELLS = 7
"""Distances are measured so far."""


class Clearance(NamedTuple):
    """Distances in a window of cells."""

    square: Squares
    """(nx, ny, nz): squared distance to the nearest occupied cell, in cells, at most 49."""
    known: NDArray[np.bool_]
    """(nx, ny, nz)."""
    low: NDArray[np.int64]
    """(3,): the lowest cell, counted from the frame's origin."""
    cell_m: float

    @property
    def far_m(self) -> float:
        """Distances at and beyond which nothing more is known."""
        return FAR_CELLS * self.cell_m

    def at(self, places: Array) -> Array:
        """Distances (K,) m at places (K, 3); 0 outside of the window."""
        cells = np.floor(places / self.cell_m).astype(np.int64) - self.low
        inside = ((cells >= 0) & (cells < self.square.shape)).all(axis=1)
        cells[~inside] = 0
        found = np.sqrt(self.square[tuple(cells.T)].astype(np.float64)) * self.cell_m
        return np.where(inside, found, 0.0)


def clearance_of(
    scores: Scores, low: NDArray[np.int64], cell_m: float, upright_cells: int
) -> Clearance:
    """Distances from scores; a cell counts as known if one within `upright_cells` over or under it is.

    The nodding scan leaves gaps between its lines; what stands in a forest is upright.
    """
    occupied = scores > 0
    seen = scores != UNKNOWN
    known = seen.copy()
    for step in range(1, upright_cells + 1):
        known[:, :, step:] |= seen[:, :, :-step]
        known[:, :, :-step] |= seen[:, :, step:]
    square = np.empty(scores.shape, np.int16)
    _measure(occupied, square, np.empty_like(square))
    return Clearance(square, known, low, cell_m)


@kernel
def _measure(occupied: NDArray[np.bool_], square: Squares, spare: Squares) -> None:
    """Exact squared distances up to `FAR_CELLS`, one axis after the other."""
    nx, ny, nz = occupied.shape
    for i in range(nx):
        for j in range(ny):
            since = FAR_CELLS
            for k in range(nz):
                since = 0 if occupied[i, j, k] else min(since + 1, FAR_CELLS)
                square[i, j, k] = since * since
            since = FAR_CELLS
            for k in range(nz - 1, -1, -1):
                since = 0 if occupied[i, j, k] else min(since + 1, FAR_CELLS)
                square[i, j, k] = min(square[i, j, k], since * since)
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                spare[i, j, k] = square[i, j, k]
            for other in range(max(j - FAR_CELLS, 0), min(j + FAR_CELLS + 1, ny)):
                away = np.int16((other - j) * (other - j))
                for k in range(nz):
                    spare[i, j, k] = min(spare[i, j, k], np.int16(square[i, other, k] + away))
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                square[i, j, k] = spare[i, j, k]
        for other in range(max(i - FAR_CELLS, 0), min(i + FAR_CELLS + 1, nx)):
            away = np.int16((other - i) * (other - i))
            for j in range(ny):
                for k in range(nz):
                    square[i, j, k] = min(square[i, j, k], np.int16(spare[other, j, k] + away))
