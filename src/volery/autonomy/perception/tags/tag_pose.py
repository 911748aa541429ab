"""Poses of tags from the corners of their images.

Frame of a tag, FLU: the origin is in the centre, z points out of the face, x to the top of the
image and y to its left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from volery.autonomy.perception.tags.detector import DetectedTag, load_opencv
from volery.core import rotations
from volery.core.arrays import Array

_IMAGE_FROM_TAG = rotations.from_yaw(0.5 * np.pi)
"""Rotation from the tag's frame to OpenCV's frame of the image: x right, y up."""


@dataclass(frozen=True, eq=False)
class TagPose:
    """Pose of a tag in the optical frame: z forward, x right, y down."""

    position: Array
    """(3,) m."""
    attitude: Array
    """(4,) x y z w, optical frame from tag."""
    error_px: float
    """Root mean square of the corners' reprojection errors."""


def tag_pose(
    tag: DetectedTag, size_m: float, matrix: Array, distortion: Array | None = None
) -> TagPose | None:
    """Returns the pose of a tag; None if there is none in front of the camera.

    size_m: side of the black border. matrix: camera matrix (3, 3). distortion: k1, k2, p1, p2, k3
    of `plumb_bob`; None: none. Of the two poses that fit a square (Collins & Bartoli,
    Infinitesimal Plane-based Pose Estimation, 2014), the one with the smaller error.
    """
    cv2 = load_opencv()
    half = 0.5 * size_m
    square = np.array(
        [[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]]
    )
    count, turns, shifts, errors = cv2.solvePnPGeneric(
        square, tag.corners_px, matrix, distortion, flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    for k in range(count):
        position = np.asarray(shifts[k], np.float64).ravel()
        if np.isfinite(position).all() and position[2] > 0.0:
            turn = rotations.exponential(np.asarray(turns[k], np.float64).ravel())
            attitude = rotations.multiply(turn, _IMAGE_FROM_TAG)
            return TagPose(position, attitude, float(np.ravel(errors[k])[0]))
    return None


def position_covariance(pose: TagPose, tag: DetectedTag, focal_px: float, sigma_px: float) -> Array:
    """Returns the covariance (3, 3) m2 of a position, for corner errors of `sigma_px`.

    The centre has half the error of a corner; the distance that of the side, along the ray.
    """
    distance = float(np.linalg.norm(pose.position))
    ray = pose.position / distance
    across = 0.5 * sigma_px * pose.position[2] / focal_px
    along = distance * sigma_px / tag.side_px
    outer = np.outer(ray, ray)
    return np.asarray(across**2 * (np.eye(3) - outer) + along**2 * outer)
