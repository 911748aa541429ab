"""A rolling map of where obstacles were seen lately, around a moving vehicle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class ObstacleMemory:
    """Square cells that wrap around: the map follows the vehicle without copying.

    A cell counts as occupied while it was hit `hits_needed` times and seen within `keep_s`.
    """

    def __init__(
        self,
        cell_m: float = 0.25,
        half_width_m: float = 16.0,
        keep_s: float = 8.0,
        hits_needed: int = 2,
    ) -> None:
        self._cell = cell_m
        self._reach = half_width_m
        self._keep_ns = round(keep_s * 1e9)
        self._hits_needed = hits_needed
        size = int(2 * half_width_m / cell_m)
        self._size = size
        self._address = np.full((size, size, 2), np.iinfo(np.int64).min)
        self._seen_ns = np.zeros((size, size), dtype=np.int64)
        self._hits = np.zeros((size, size), dtype=np.int64)

    def add(self, points: Array, time_ns: int) -> None:
        """Mark the cells of points (K, 2), m in a fixed frame."""
        if len(points) == 0:
            return
        cells = np.unique(np.floor(points / self._cell).astype(np.int64), axis=0)
        i, j = cells[:, 0] % self._size, cells[:, 1] % self._size
        renewed = np.any(self._address[i, j] != cells, axis=1)
        expired = time_ns - self._seen_ns[i, j] > self._keep_ns
        self._hits[i, j] = np.where(renewed | expired, 1, self._hits[i, j] + 1)
        self._address[i, j] = cells
        self._seen_ns[i, j] = time_ns

    def around(self, center: Array, time_ns: int, radius_m: float) -> Array:
        """Centres (K, 2) of occupied cells within `radius_m` of `center`, relative to it."""
        alive = (self._hits >= self._hits_needed) & (time_ns - self._seen_ns <= self._keep_ns)
        relative = (self._address[alive] + 0.5) * self._cell - center
        near = np.hypot(relative[:, 0], relative[:, 1]) <= min(radius_m, self._reach)
        return np.asarray(relative[near])
