"""Computes parts of observations from sensors: pure functions over arrays of any leading shape.

Parts of LIDARs and depth images are closeness: 1 at the sensor, 0 at the maximum distance of the
part and beyond it, so that missing data and free space look alike.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.arrays import Array
from volery.core.errors import ScenarioError


def closeness(distance: ArrayLike, max_distance_m: float) -> NDArray[np.float32]:
    """Returns closeness, 0 to 1, of distances, m: NaN and +inf are 0, -inf (too near) is 1."""
    distance = np.asarray(distance, np.float32)
    fraction = np.float32(1.0) - distance / np.float32(max_distance_m)
    return np.clip(np.where(np.isnan(fraction), np.float32(0.0), fraction), 0.0, 1.0)


def lidar_sectors(
    ranges: ArrayLike,
    angles: Array,
    *,
    sectors: int,
    angle_min_rad: float,
    angle_max_rad: float,
    max_range_m: float,
) -> NDArray[np.float32]:
    """Returns the closeness (..., sectors) of the nearest echo in each sector of a planar scan.

    ranges: (..., B) m; +inf no echo, -inf below the minimum range. angles: (B,) rad, of the beams,
    increasing. Sectors are equal parts from `angle_min_rad` to `angle_max_rad`; beams beyond them
    are ignored. Raises `ScenarioError` if a sector has no beam.
    """
    near = closeness(ranges, max_range_m)
    width = (angle_max_rad - angle_min_rad) / sectors
    number = np.floor((angles - angle_min_rad) / width).astype(np.int64)
    used = np.flatnonzero((number >= 0) & (number < sectors))
    first = np.searchsorted(number[used], np.arange(sectors))
    if len(used) == 0 or not np.array_equal(
        number[used][np.minimum(first, len(used) - 1)], np.arange(sectors)
    ):
        raise ScenarioError(
            f"a scan of {len(angles)} beams from {angles[0]:.2f} to {angles[-1]:.2f} rad has no "
            f"beam in some of the {sectors} sectors from {angle_min_rad:.2f} to "
            f"{angle_max_rad:.2f} rad; use fewer sectors"
        )
    inside = near[..., used[0] : used[-1] + 1]
    return np.asarray(np.maximum.reduceat(inside, first, axis=-1))


def lidar_scan(ranges: ArrayLike, *, max_range_m: float) -> NDArray[np.float32]:
    """Returns the closeness (..., B) of each echo of a scan; ranges: (..., B) m."""
    return closeness(ranges, max_range_m)


def depth_image(depth: ArrayLike, *, max_depth_m: float) -> NDArray[np.float32]:
    """Returns the closeness (..., H * W), row by row, of a depth image (..., H, W), m."""
    near = closeness(depth, max_depth_m)
    return near.reshape(*near.shape[:-2], -1)


def colour_image(colour: ArrayLike) -> NDArray[np.float32]:
    """Returns an image (..., H, W, 3) of bytes as (..., 3 * H * W) numbers from 0 to 1.

    Channel by channel, then row by row, as convolutions take them.
    """
    image = np.moveaxis(np.asarray(colour, np.float32), -1, -3) / np.float32(255.0)
    return image.reshape(*image.shape[:-3], -1)
