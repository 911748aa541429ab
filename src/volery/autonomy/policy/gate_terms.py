"""Gates that are flown through: when a path passes one, and which are ahead.

A gate is (x, y, z, yaw) of its centre, m and rad, map. It is upright; its direction is its x axis,
horizontal; y and z span its opening. Environments and nodes call the same functions.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array


def in_gates(position: Array, gates: Array) -> Array:
    """Returns positions (..., 3) in the frames of the gates (..., G, 4): (..., G, 3)."""
    apart = position[..., None, :] - gates[..., :3]
    c, s = np.cos(gates[..., 3]), np.sin(gates[..., 3])
    x, y, z = np.moveaxis(apart, -1, 0)
    return np.stack([c * x + s * y, c * y - s * x, z], axis=-1)


def off_centre(before: Array, now: Array) -> Array:
    """Returns how far (...) from the centre, along y or z, a path meets the gate's plane, m.

    before, now: (..., 3) ends of the path in the gate's frame.
    """
    step = now[..., 0] - before[..., 0]
    fraction = np.clip(-before[..., 0] / np.where(step == 0.0, 1.0, step), 0.0, 1.0)
    crossing = before + fraction[..., None] * (now - before)
    return np.asarray(np.abs(crossing[..., 1:]).max(axis=-1))


def passes(before: Array, now: Array, room_m: float) -> NDArray[np.bool_]:
    """Returns whether a path (..., 3) passes the gate forwards, at most `room_m` off its centre."""
    forward = (before[..., 0] < 0.0) & (now[..., 0] >= 0.0)
    return np.asarray(forward & (off_centre(before, now) <= room_m))


def directions(yaw: Array) -> Array:
    """Returns the directions (..., 3), map, of gates with the yaws (...), rad."""
    return np.stack([np.cos(yaw), np.sin(yaw), np.zeros_like(yaw)], axis=-1)
