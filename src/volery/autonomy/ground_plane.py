"""The slope of the ground ahead, from the lowest LIDAR returns."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import kernel

Array = NDArray[np.float64]

_CELL_M = 2.0
_CELLS = 16
_RADIUS_M = 13.0
_NOISE_M = 0.05
_ENOUGH, _BELOW_M = 8, 0.5
"""So many cells with returns so far below the vehicle tell the height where no sonar does."""
_RIDGE = 8.0
"""Weight that pulls the slope to zero where few returns reach the ground."""


class GroundPlane:
    """Plane z = height + slope . (xy - anchor), fitted to the lowest recent point of each cell."""

    def __init__(self, keep_s: float = 3.0) -> None:
        self._keep_ns = round(keep_s * 1e9)
        self._low = np.zeros((_CELLS, _CELLS, 3))
        self._seen_ns = np.full((_CELLS, _CELLS), -(1 << 60), dtype=np.int64)
        self.anchor = np.zeros(2)
        self.height = 0.0
        self.slope = np.zeros(2)

    def height_at(self, xy: Array) -> Array:
        """Height of the plane below points (..., 2), m."""
        return np.asarray(self.height + (xy - self.anchor) @ self.slope)

    def add(self, points: Array, time_ns: int) -> None:
        """Take in points (K, 3), m in a fixed frame."""
        _keep_lowest(points, time_ns, self._keep_ns, self._low, self._seen_ns)

    def fit(self, position: Array, height_below: float | None, time_ns: int) -> None:
        """Refit around `position` (3,); `height_below` is the ground's height there if known.

        Where it is not, the returns tell that, too.
        """
        fresh = self._low[time_ns - self._seen_ns <= self._keep_ns]
        offset = fresh[:, :2] - position[:2]
        near = np.hypot(offset[:, 0], offset[:, 1]) < _RADIUS_M
        offset, z = offset[near], fresh[near, 2]
        base = height_below if height_below is not None else float(self.height_at(position[:2]))
        low = z < position[2] - _BELOW_M
        is_told = height_below is not None or low.sum() < _ENOUGH
        slope = self.slope
        for _ in range(3):
            residual = z - base - offset @ slope
            # Points well above the plane are trunks and leaves, not ground.
            weight = 1.0 / (1.0 + (np.maximum(residual, 0.0) / 0.4) ** 2 + (residual / 2.0) ** 2)
            normal = (offset * weight[:, None]).T @ offset + _RIDGE * np.eye(2)
            slope = np.linalg.solve(normal, (offset * weight[:, None]).T @ (z - base))
            if not is_told:
                left = (z - base - offset @ slope)[low]
                base += float(weight[low] @ left / weight[low].sum())
        steepness = float(np.hypot(*slope))
        self.slope = slope if steepness < 1.0 else slope / steepness
        self.anchor = position[:2].copy()
        self.height = base


@kernel
def _keep_lowest(
    points: Array, time_ns: int, keep_ns: int, low: Array, seen_ns: NDArray[np.int64]
) -> None:
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        i, j = math.floor(x / _CELL_M) % _CELLS, math.floor(y / _CELL_M) % _CELLS
        stale = time_ns - seen_ns[i, j] > keep_ns
        moved = abs(x - low[i, j, 0]) + abs(y - low[i, j, 1]) > 2.0 * _CELL_M
        if stale or moved or z <= low[i, j, 2] + _NOISE_M:
            low[i, j, 0], low[i, j, 1], low[i, j, 2] = x, y, z
            seen_ns[i, j] = time_ns
