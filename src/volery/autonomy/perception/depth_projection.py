"""Depth images of a forward-looking camera: mean depths of regions, and 3D points."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.scan_points import OdometrySample
from volery.core.arrays import Array
from volery.core.compiled import kernel
from volery.core.errors import GraphError
from volery.core.rotation_kernels import rotate_vector
from volery.graph.messages import CameraInfo, Image

DepthImage = NDArray[np.float32]

_NEAREST_M = 0.3
"""Min depth; nearer points are on the vehicle itself."""


def depth_of(image: Image) -> DepthImage:
    """Returns depths (height, width), m, NaN if unknown. Raises GraphError for other encodings."""
    shape = image.height, image.width
    if image.encoding == "32FC1":
        return image.data.view(np.float32).reshape(shape)
    if image.encoding == "16UC1":
        millimetres = image.data.view(np.uint16).reshape(shape).astype(np.float32)
        return np.where(millimetres > 0.0, millimetres * np.float32(1e-3), np.float32(np.nan))
    raise GraphError(f"depth images must be 32FC1 or 16UC1, not '{image.encoding}'")


def region_of(depth: DepthImage, width: float, height: float, aside: float = 0.0) -> DepthImage:
    """Returns the centre of an image, with these fractions of its width and height.

    aside: shift to the right, as a fraction of the width.
    """
    rows, columns = depth.shape
    half_r, half_c = max(round(rows * height / 2), 1), max(round(columns * width / 2), 1)
    r, c = rows // 2, round(columns * (0.5 + aside))
    return depth[max(r - half_r, 0) : r + half_r, max(c - half_c, 0) : c + half_c]


def mean_depth(region: DepthImage, far_m: float) -> float:
    """Returns a region's mean depth as a fraction of `far_m`; larger or unknown depths count 1."""
    fraction = np.clip(np.nan_to_num(region, nan=np.inf) / far_m, 0.0, 1.0)
    return float(fraction.mean()) if fraction.size else 1.0


class DepthProjector:
    """Projects images of a camera at `mount` (3,) m in the body, facing forward, to points."""

    def __init__(
        self, mount: Sequence[float], max_range_m: float = 12.0, keep_every: int = 2
    ) -> None:
        self._mount = np.array(mount, dtype=np.float64)
        self._max_range_m = max_range_m
        self._every = keep_every

    def points(self, image: Image, info: CameraInfo, pose: OdometrySample) -> Array:
        """Returns points (K, 3) m within range in the odometry frame.

        The pose is extrapolated to the image's stamp. Lens distortion is not corrected.
        """
        depth = np.ascontiguousarray(depth_of(image))
        stamp = image.header.stamp.sec * 1_000_000_000 + image.header.stamp.nanosec
        points = np.empty((math.ceil(depth.shape[0] / self._every) * depth.shape[1], 3))
        count = _project(
            depth,
            self._every,
            self._max_range_m,
            np.asarray(info.k, dtype=np.float64),
            (stamp - pose.time_ns) * 1e-9,
            self._mount,
            pose.position,
            pose.attitude,
            pose.velocity,
            points,
        )
        return points[:count]


@kernel
def _project(
    depth: DepthImage,
    every: int,
    max_range: float,
    k: Array,
    since_pose: float,
    mount: Array,
    position: Array,
    attitude: Array,
    velocity: Array,
    points: Array,
) -> int:
    """Fills `points`, returns their number. k: the intrinsic matrix, row by row."""
    count = 0
    for v in range(0, depth.shape[0], every):
        for u in range(0, depth.shape[1], every):
            z = float(depth[v, u])
            if not _NEAREST_M < z < max_range:
                continue
            left, up = -(u - k[2]) / k[0] * z, -(v - k[5]) / k[4] * z
            x, y, h = rotate_vector(
                attitude[0],
                attitude[1],
                attitude[2],
                attitude[3],
                z + mount[0],
                left + mount[1],
                up + mount[2],
            )
            points[count, 0] = position[0] + velocity[0] * since_pose + x
            points[count, 1] = position[1] + velocity[1] * since_pose + y
            points[count, 2] = position[2] + velocity[2] * since_pose + h
            count += 1
    return count
