"""Estimates the slope of the ground ahead from the lowest LIDAR returns."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.compiled import brief_kernel

_CELL_M = 2.0
_CELLS = 16
_RADIUS_M = 13.0
_NOISE_M = 0.05
_ENOUGH, _BELOW_M = 8, 0.5
"""Number of cells with returns so far below the vehicle that give the height without a sonar."""
_RIDGE = 8.0 * np.eye(2)
"""Weight that regularizes the slope to zero if few returns are on the ground."""


class GroundPlane:
    """Plane z = height + slope . (xy - anchor), fitted to the lowest recent point of each cell."""

    def __init__(self, keep_s: float = 3.0) -> None:
        self._keep_ns = round(keep_s * 1e9)
        self._low = np.zeros((_CELLS, _CELLS, 3))
        self._seen_ns = np.full((_CELLS, _CELLS), -(1 << 60), dtype=np.int64)
        self.anchor = np.zeros(2)
        self.height = 0.0
        self.slope: Array = np.zeros(2)

    def height_at(self, xy: Array) -> Array:
        """Returns the height of the plane below points (..., 2), m."""
        return np.asarray(self.height + (xy - self.anchor) @ self.slope)

    def add(self, points: Array, time_ns: int, hits: NDArray[np.bool_] | None = None) -> None:
        """Adds points (K, 3), m in a fixed frame; `hits` (K,) False: no return there."""
        if hits is None:
            hits = np.ones(len(points), np.bool_)
        _keep_lowest(points, hits, time_ns, self._keep_ns, self._low, self._seen_ns)

    def fit(self, position: Array, height_below: float | None, time_ns: int) -> None:
        """Fits the plane around `position` (3,) m.

        `height_below` is the ground height there; None: it is estimated from the returns.
        """
        near = _near(self._low, self._seen_ns, time_ns - self._keep_ns, position)
        offset, z = near[:, :2].copy(), near[:, 2].copy()
        base = height_below if height_below is not None else float(self.height_at(position[:2]))
        low = z < position[2] - _BELOW_M
        is_base_known = height_below is not None or low.sum() < _ENOUGH
        slope = self.slope
        for _ in range(3):
            residual = z - base - offset @ slope
            # Points well above the plane are trunks and leaves, not ground.
            weight = 1.0 / (1.0 + (np.maximum(residual, 0.0) / 0.4) ** 2 + (residual / 2.0) ** 2)
            normal = (offset * weight[:, None]).T @ offset + _RIDGE
            slope = np.linalg.solve(normal, (offset * weight[:, None]).T @ (z - base)).astype(
                np.float64
            )
            if not is_base_known:
                left = (z - base - offset @ slope)[low]
                base += float(weight[low] @ left / weight[low].sum())
        steepness = float(np.hypot(*slope))
        self.slope = slope if steepness < 1.0 else slope / steepness
        self.anchor = position[:2].copy()
        self.height = base


@brief_kernel
def _near(low: Array, seen_ns: NDArray[np.int64], since_ns: int, position: Array) -> Array:
    """Returns points (K, 3) seen since then, their x and y relative to `position`."""
    out, count = np.empty((low.shape[0] * low.shape[1], 3)), 0
    for i in range(low.shape[0]):
        for j in range(low.shape[1]):
            x, y = low[i, j, 0] - position[0], low[i, j, 1] - position[1]
            if seen_ns[i, j] >= since_ns and math.hypot(x, y) < _RADIUS_M:
                out[count, 0], out[count, 1], out[count, 2] = x, y, low[i, j, 2]
                count += 1
    return out[:count]


@brief_kernel
def _keep_lowest(
    points: Array,
    hits: NDArray[np.bool_],
    time_ns: int,
    keep_ns: int,
    low: Array,
    seen_ns: NDArray[np.int64],
) -> None:
    for k in np.flatnonzero(hits):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        i, j = math.floor(x / _CELL_M) % _CELLS, math.floor(y / _CELL_M) % _CELLS
        stale = time_ns - seen_ns[i, j] > keep_ns
        moved = abs(x - low[i, j, 0]) + abs(y - low[i, j, 1]) > 2.0 * _CELL_M
        if stale or moved or z <= low[i, j, 2] + _NOISE_M:
            low[i, j, 0], low[i, j, 1], low[i, j, 2] = x, y, z
            seen_ns[i, j] = time_ns
