"""Computes distances to the nearest occupied cell, exact up to a few cells, axis by axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel, kernel

Squares = NDArray[np.int16]


def squared_distances(occupied: NDArray[np.bool_], far_cells: int) -> Squares:
    """Returns squared distances (nx, ny, nz), in cells, to the nearest occupied cell.

    They are between the cells' centres. Distances beyond `far_cells` are clipped to it.
    """
    square = np.empty(occupied.shape, np.int16)
    _measure(occupied, far_cells, square, np.empty_like(square))
    return square


@kernel
def _measure(occupied: NDArray[np.bool_], far: int, square: Squares, spare: Squares) -> None:
    nx, ny, nz = occupied.shape
    for i in range(nx):
        for j in range(ny):
            _along_column(occupied[i, j], far, square[i, j])
    for i in range(nx):
        _copy(square[i], spare[i])
        for j in range(ny):
            for other in range(max(j - far, 0), min(j + far + 1, ny)):
                away = np.int16((other - j) * (other - j))
                for k in range(nz):
                    spare[i, j, k] = min(spare[i, j, k], np.int16(square[i, other, k] + away))
    for i in range(nx):
        _copy(spare[i], square[i])
        for other in range(max(i - far, 0), min(i + far + 1, nx)):
            away = np.int16((other - i) * (other - i))
            for j in range(ny):
                for k in range(nz):
                    square[i, j, k] = min(square[i, j, k], np.int16(spare[other, j, k] + away))


@inner_kernel
def _copy(square: NDArray[np.int16], into: NDArray[np.int16]) -> None:
    for j in range(square.shape[0]):  # an assignment of arrays takes seconds to compile
        for k in range(square.shape[1]):
            into[j, k] = square[j, k]


@inner_kernel
def _along_column(occupied: NDArray[np.bool_], far: int, square: NDArray[np.int16]) -> None:
    """Computes squared distances within one column, from below and from above."""
    since = far
    for k in range(len(occupied)):
        since = 0 if occupied[k] else min(since + 1, far)
        square[k] = since * since
    since = far
    for k in range(len(occupied) - 1, -1, -1):
        since = 0 if occupied[k] else min(since + 1, far)
        square[k] = min(square[k], since * since)
