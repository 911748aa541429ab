"""Converts laser scans to returns in the plane of the body."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.static_transforms import Mount
from volery.autonomy.slam.planar.settings import ReturnSettings
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.compiled import kernel
from volery.graph.messages import LaserScan


def returns(scan: LaserScan, mount: Mount, velocity: Array, kept: ReturnSettings) -> Array:
    """Returns the returns (K, 2) m in the body at the time of the first beam.

    velocity: (3,) of the body in its own axes, m/s and rad/s, which places each beam.
    """
    ranges = np.asarray(scan.ranges, np.float64)
    nearest = max(kept.nearest_m, float(scan.range_min))
    max_range_m = min(kept.max_range_m, 0.99 * float(scan.range_max) or math.inf)
    rows = np.flatnonzero((ranges >= nearest) & (ranges <= max_range_m))
    if len(rows) == 0:
        return np.zeros((0, 2))
    angle = float(scan.angle_min) + rows * float(scan.angle_increment)
    flat = np.zeros((len(rows), 3))
    flat[:, 0], flat[:, 1] = ranges[rows] * np.cos(angle), ranges[rows] * np.sin(angle)
    points: Array = (rotations.rotate(mount.attitude, flat) + mount.position)[:, :2]
    after = rows * float(scan.time_increment)
    if after[-1] > 0.0:
        c, s = np.cos(velocity[2] * after), np.sin(velocity[2] * after)
        points = np.stack(
            [
                c * points[:, 0] - s * points[:, 1] + velocity[0] * after,
                s * points[:, 0] + c * points[:, 1] + velocity[1] * after,
            ],
            axis=1,
        )
    return points


def thinned(points: Array, apart: float, max_points: int) -> Array:
    """Returns at most `max_points` of points (K, 2), in beam order, at least `apart` m apart."""
    kept = np.zeros(len(points), np.bool_)
    _thin(points, apart, kept)
    chosen = points[kept]
    if len(chosen) > max_points:
        chosen = chosen[np.linspace(0, len(chosen) - 1, max_points).round().astype(np.int64)]
    return np.ascontiguousarray(chosen)


@kernel
def _thin(points: Array, apart: float, kept: NDArray[np.bool_]) -> None:
    last = -1
    for k in range(points.shape[0]):
        if last >= 0:
            dx, dy = points[k, 0] - points[last, 0], points[k, 1] - points[last, 1]
            if dx * dx + dy * dy < apart * apart:
                continue
        kept[k] = True
        last = k
