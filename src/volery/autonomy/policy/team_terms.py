"""Observations of teams: neighbours and vertical posts, as pure functions over arrays.

Arrays have any leading shape. The level heading frame is the map frame, turned by the UAV's yaw.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array

NEIGHBOUR_SIZE = 7
"""Numbers of one neighbour."""
POST_SIZE = 2
"""Numbers of one post."""


def neighbours(
    position: Array,
    velocity: Array,
    is_present: NDArray[np.bool_],
    *,
    count: int,
    position_scale_m: float,
    velocity_scale_m_s: float,
) -> Array:
    """Returns the nearest `count` of N neighbours, (..., count * 7), the nearest first.

    position, velocity: (..., N, 3) relative to the UAV, m and m/s, in its level heading frame.
    is_present: (..., N). Each neighbour has position and velocity over their scales, and 1; those
    that are not there have zeros.
    """
    numbers = np.concatenate(
        [
            position / position_scale_m,
            velocity / velocity_scale_m_s,
            np.ones_like(position[..., :1]),
        ],
        axis=-1,
    )
    distance = np.where(is_present, np.linalg.norm(position, axis=-1), np.inf)
    return _nearest(np.where(is_present[..., None], numbers, 0.0), distance, count)


def posts(position: Array, radius: Array, *, count: int, range_m: float) -> Array:
    """Returns the nearest `count` of P vertical posts, (..., count * 2), the nearest first.

    position: (..., P, 2) of their axes relative to the UAV, m, in its level heading frame; radius:
    (..., P) m, 0 for none. Each post is its direction times exp(-d / `range_m`), with the distance
    d to its surface: a vector that is long near the post and has no jump where a post appears.
    """
    to_axis = np.linalg.norm(position, axis=-1)
    is_present = radius > 0.0
    distance = np.where(is_present, np.maximum(to_axis - radius, 0.0), np.inf)
    length = np.exp(-distance / range_m) / np.maximum(to_axis, 1e-6)
    return _nearest(position * length[..., None], distance, count)


def _nearest(numbers: Array, distance: Array, count: int) -> Array:
    """Returns the rows of `numbers` (..., N, S) at the smallest distances; 0 where N < count."""
    order = np.argsort(distance, axis=-1, kind="stable")[..., :count, None]
    chosen = np.take_along_axis(numbers, order, axis=-2)
    missing = count - chosen.shape[-2]
    if missing > 0:
        chosen = np.concatenate(
            [chosen, np.zeros((*chosen.shape[:-2], missing, chosen.shape[-1]))], -2
        )
    return np.asarray(chosen.reshape(*chosen.shape[:-2], -1))
