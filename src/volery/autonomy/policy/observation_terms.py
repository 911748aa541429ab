"""Computes parts of observations from states: pure functions over arrays of any leading shape.

The environments of `volery.learning` call them with all UAVs of all environments, the node `policy`
with one UAV. Vectors have shape (..., 3), attitudes (..., 4): quaternions x y z w, map from body.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from volery.core import rotations
from volery.core.arrays import Array


def to_body(attitude: ArrayLike, vectors_map: ArrayLike) -> Array:
    """Returns vectors of the map frame in the body frames (FLU)."""
    return rotations.rotate(rotations.conjugate(attitude), vectors_map)


def to_heading(attitude: ArrayLike, vectors_map: ArrayLike) -> Array:
    """Returns vectors of the map frame in the level heading frames."""
    yaw = rotations.yaw_of(attitude)
    c, s = np.cos(yaw), np.sin(yaw)
    x, y, z = np.moveaxis(np.asarray(vectors_map, np.float64), -1, 0)
    return np.stack([c * x + s * y, c * y - s * x, z], axis=-1)


def rotation_rows(attitude: ArrayLike) -> Array:
    """Returns rotation matrices, map from body, row by row (..., 9)."""
    matrices = rotations.matrix(attitude)
    return matrices.reshape(*matrices.shape[:-2], 9)


def scaled(numbers: ArrayLike, scale: float, limit: float) -> Array:
    """Returns numbers (..., size) as the network takes them: divided by `scale`, then clipped."""
    return np.clip(np.asarray(numbers) / scale, -limit, limit)


def stacked(history: Array | None, numbers: Array, length: int) -> Array:
    """Returns a history (..., H, size) with new numbers (..., size) at its end.

    history: the one before; None: the new numbers are the first, and fill it. length: H.
    """
    newest = numbers[..., None, :]
    if history is None:
        return np.repeat(newest, length, axis=-2)
    return np.concatenate([history[..., 1:, :], newest], axis=-2)
