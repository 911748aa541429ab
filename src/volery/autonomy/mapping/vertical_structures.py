"""Detects vertical structures from returns at all heights, above the ground below them.

A crown is above free space and the ground is flat; a trunk has returns at several heights of one
position.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array

_GROUND_WITHIN_M, _LOWEST_FRACTION, _MIN_GROUND = 1.5, 0.05, 6
"""Radius, quantile and min number of the lowest returns around a position that give the ground."""
_BESIDE_M = 0.3
_FOOT_M, _BAND_M, _BANDS = 0.6, 0.4, 4
"""Heights above ground: lower limit of the bands (undergrowth, errors of the ground), their height
and number.
"""
_MIN_RETURNS, _MIN_BANDS = 2, 3
_CLEAR_M = 1.0
"""Height below which a return of a level scan may be ground (modelling choices)."""
_CELL_M = 0.5
"""Cell size in which the ground counts as level, for many queries."""


class _Cells:
    """Index of points (N, 3) by their horizontal position."""

    def __init__(self, points: Array, size_m: float) -> None:
        self._size = size_m
        cells = np.floor(points[:, :2] / size_m).astype(np.int64)
        order = np.argsort(_key(cells), kind="stable")
        self._points, self._keys = points[order], _key(cells)[order]

    def near(self, position: Array) -> Array:
        """Returns the points (K, 3) within a cell's size of a position (2,)."""
        i, j = np.floor(position / self._size).astype(np.int64)
        low, high = (np.array([(i + a, j + b) for a in (-1, 0, 1)]) for b in (-1, 1))
        first = np.searchsorted(self._keys, _key(low), side="left")
        end = np.searchsorted(self._keys, _key(high), side="right")
        found = np.concatenate([self._points[a:b] for a, b in zip(first, end, strict=True)])
        return np.asarray(found[np.hypot(*(found[:, :2] - position).T) <= self._size])


def _key(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns keys of cells (N, 2); those of one column are consecutive."""
    return np.asarray(cells[:, 0] * (1 << 32) + cells[:, 1])


class VerticalStructures:
    """Index of returns (N, 3) of the map, m, that detects vertical structures."""

    def __init__(self, points: Array) -> None:
        self._grounds: dict[tuple[int, int], float] = {}
        self._wide, self._slim = _Cells(points, _GROUND_WITHIN_M), _Cells(points, _BESIDE_M)

    def ground_m(self, position: Array) -> float:
        """Returns the ground height at a position (2,) of the map; nan if unknown."""
        heights = self._wide.near(position)[:, 2]
        if len(heights) < _MIN_GROUND:
            return float("nan")
        return float(np.quantile(heights, _LOWEST_FRACTION))

    def heights_m(self, seen: Array) -> Array:
        """Returns the heights (K,) of points (K, 3) above the ground; nan if unknown."""
        cells = np.floor(seen[:, :2] / _CELL_M).astype(np.int64)
        _, first, of = np.unique(_key(cells), return_index=True, return_inverse=True)
        ground = np.array([self._cell_ground(int(i), int(j)) for i, j in cells[first]])
        return np.asarray(seen[:, 2] - ground[of.ravel()]) if len(seen) else np.zeros(0)

    def _cell_ground(self, i: int, j: int) -> float:
        if (i, j) not in self._grounds:
            self._grounds[i, j] = self.ground_m((np.array([i, j]) + 0.5) * _CELL_M)
        return self._grounds[i, j]

    def stands(self, seen: Array) -> bool:
        """Returns whether a point (3,) is above the ground and its structure reaches down to it."""
        ground = self.ground_m(seen[:2])
        if not seen[2] - ground > _CLEAR_M:  # also if the ground is unknown
            return False
        above = self._slim.near(seen[:2])[:, 2] - ground
        bands = np.floor((above - _FOOT_M) / _BAND_M)
        met = [int((bands == band).sum()) >= _MIN_RETURNS for band in range(_BANDS)]
        return sum(met) >= _MIN_BANDS
