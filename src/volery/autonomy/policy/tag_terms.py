"""Observes an AprilTag: pure functions over arrays of any leading shape.

A tag's pose comes from a camera, at the time of an image; the policy observes it in the level
heading frame, carried on by the UAV's own motion since. Frame of a tag: x to the top of its
image, y to the left, z out of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from volery.autonomy.policy.observation_terms import to_heading
from volery.core import rotations
from volery.core.arrays import Array

TAG_SIZE = 6
"""Numbers of `tag_observation`."""
CAMERA_FROM_OPTICAL = np.array([-0.5, 0.5, -0.5, 0.5])
"""Rotation from optical axes (z forward, x right, y down) to those of a mount (x forward)."""


def tag_from_uav(
    position_optical: ArrayLike,
    attitude_optical: ArrayLike,
    attitude: ArrayLike,
    mount_m: ArrayLike,
    mount_rpy_deg: ArrayLike,
) -> tuple[Array, Array]:
    """Returns vectors (..., 3), m, from the UAV to a tag, map axes, and the tag's yaws (...), rad.

    position_optical, attitude_optical: poses (..., 3) and (..., 4) of the tag in the optical frame.
    attitude: the UAV's (..., 4) at the time of the image. mount_m, mount_rpy_deg: the camera's
    position (3,) and roll, pitch and yaw (3,) in the body.
    """
    roll, pitch, yaw = np.radians(np.asarray(mount_rpy_deg, np.float64))
    mounted = rotations.multiply(rotations.from_rpy(roll, pitch, yaw), CAMERA_FROM_OPTICAL)
    body = np.asarray(mount_m, np.float64) + rotations.rotate(mounted, position_optical)
    turned = rotations.multiply(attitude, rotations.multiply(mounted, attitude_optical))
    return rotations.rotate(attitude, body), rotations.yaw_of(turned)


def tag_observation(
    to_tag_map: ArrayLike,
    tag_yaw: ArrayLike,
    age_s: ArrayLike,
    attitude: ArrayLike,
    *,
    range_m: float,
    memory_s: float,
) -> Array:
    """Returns observations (..., 6) of a tag.

    Position of the tag in the level heading frame by `range_m` (3), cosine and sine of its yaw
    relative to the heading (2), age of the last detection by `memory_s` (1). A tag that was not
    detected for `memory_s` is unknown: zeros, and an age of 1.

    to_tag_map: vectors (..., 3) from the UAV to the tag, carried on to the present. age_s: (...),
    inf for a tag that was never detected.
    """
    age = np.minimum(np.asarray(age_s, np.float64) / memory_s, 1.0)
    turn = np.asarray(tag_yaw, np.float64) - rotations.yaw_of(attitude)
    numbers = np.concatenate(
        [
            to_heading(attitude, to_tag_map) / range_m,
            np.stack([np.cos(turn), np.sin(turn)], axis=-1),
        ],
        axis=-1,
    )
    known = np.where(age[..., None] < 1.0, numbers, 0.0)
    return np.concatenate([known, age[..., None]], axis=-1)
