"""A rolling map of recently observed obstacles around a moving vehicle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.compiled import kernel

Integers = NDArray[np.int64]


class ObstacleMemory:
    """Square cells that wrap around: the map follows the vehicle without copying.

    A cell is occupied if it was observed within `keep_s`, in at least `looks_needed` scans or
    images.
    """

    def __init__(
        self,
        cell_m: float = 0.25,
        half_width_m: float = 16.0,
        keep_s: float = 10.0,
        looks_needed: int = 1,
    ) -> None:
        self._cell = cell_m
        self._half_width_m = half_width_m
        self._keep_ns = round(keep_s * 1e9)
        self._looks_needed = looks_needed
        size = int(2 * half_width_m / cell_m)
        self._address = np.full((size, size, 2), np.iinfo(np.int64).min)
        self._seen_ns = np.zeros((size, size), dtype=np.int64)
        self._looks = np.zeros((size, size), dtype=np.int64)

    def add(self, points: Array, time_ns: int) -> None:
        """Marks the cells of the points (K, 2+) of one scan or image, m in a fixed frame."""
        _mark(points, time_ns, self._cell, self._keep_ns, self._address, self._seen_ns, self._looks)

    def around(self, center: Array, time_ns: int, radius_m: float) -> Array:
        """Returns the centres (K, 2) of occupied cells within `radius_m`, relative to `center`."""
        found = np.empty((self._looks.size, 2))
        count = _gather(
            center[0],
            center[1],
            min(radius_m, self._half_width_m),
            time_ns - self._keep_ns,
            self._cell,
            self._looks_needed,
            self._address,
            self._seen_ns,
            self._looks,
            found,
        )
        return found[:count].copy()


@kernel
def _mark(
    points: Array,
    time_ns: int,
    cell: float,
    keep_ns: int,
    address: Integers,
    seen_ns: Integers,
    looks: Integers,
) -> None:
    size = address.shape[0]
    for k in range(points.shape[0]):
        a, b = math.floor(points[k, 0] / cell), math.floor(points[k, 1] / cell)
        i, j = a % size, b % size
        other = address[i, j, 0] != a or address[i, j, 1] != b
        if other or time_ns - seen_ns[i, j] > keep_ns:
            looks[i, j] = 1
        elif seen_ns[i, j] != time_ns:
            looks[i, j] += 1
        address[i, j, 0], address[i, j, 1] = a, b
        seen_ns[i, j] = time_ns


@kernel
def _gather(
    x: float,
    y: float,
    radius: float,
    since_ns: int,
    cell: float,
    looks_needed: int,
    address: Integers,
    seen_ns: Integers,
    looks: Integers,
    found: Array,
) -> int:
    count = 0
    for i in range(address.shape[0]):
        for j in range(address.shape[1]):
            if looks[i, j] < looks_needed or seen_ns[i, j] < since_ns:
                continue
            dx, dy = (address[i, j, 0] + 0.5) * cell - x, (address[i, j, 1] + 0.5) * cell - y
            if dx * dx + dy * dy <= radius * radius:
                found[count, 0], found[count, 1] = dx, dy
                count += 1
    return count
