"""Turns actions into commands: pure functions over arrays of any leading shape.

Continuous actions are numbers from -1 to 1. Thrusts and rotor speeds are in the unit of the hover
and maximum values that the caller passes: N and rad/s, or fractions of the maximum.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core import rotations
from volery.core.arrays import Array

_AXES = np.array(
    [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64
)
DISCRETE_VELOCITIES = len(_AXES)
"""Number of choices of `discrete_velocity`."""


def velocity(action: Array, speed_m_s: float, yaw_rate_rad_s: float) -> tuple[Array, Array]:
    """Returns velocities (..., 3), m/s, level heading frame, and yaw rates (...), rad/s.

    action: (..., 4).
    """
    return speed_m_s * action[..., :3], np.asarray(yaw_rate_rad_s * action[..., 3])


def level_velocity(
    action: Array,
    height_m: ArrayLike,
    *,
    forward_m_s: float,
    lateral_m_s: float,
    keep_height_m: float,
    climb_m_s: float,
) -> Array:
    """Returns velocities (..., 3), m/s, level heading frame, that keep a height.

    action: (..., 2): -1 to 1 are 0 to `forward_m_s` ahead, and `lateral_m_s` to the right and left.
    height_m: (...) of the UAVs, which climb at the difference to `keep_height_m` by 1/s, at most at
    `climb_m_s`.
    """
    climb = np.clip(keep_height_m - np.asarray(height_m, np.float64), -climb_m_s, climb_m_s)
    ahead, aside = 0.5 * forward_m_s * (1.0 + action[..., 0]), lateral_m_s * action[..., 1]
    return np.stack([ahead, aside, climb], axis=-1)


def limited_velocity(action: Array, speed_m_s: ArrayLike) -> Array:
    """Returns velocities (..., 3), m/s, level heading frame, of actions (..., 3).

    Velocities beyond `speed_m_s` keep their direction and get this length.
    """
    length = np.linalg.norm(action, axis=-1, keepdims=True)
    return np.asarray(np.asarray(speed_m_s) * action / np.maximum(length, 1.0))


def discrete_velocity(choice: NDArray[np.int64], speed_m_s: float) -> Array:
    """Returns velocities (..., 3), m/s, level heading frame, of choices (...).

    0 hovers; 1 to 6 fly forward, back, left, right, up, down.
    """
    return np.asarray(speed_m_s * _AXES[choice])


def position(action: Array, position_map: ArrayLike, yaw: ArrayLike, range_m: float) -> Array:
    """Returns positions (..., 3), m, map, at most `range_m` along each axis from the present ones.

    action: (..., 3) along the axes of the level heading frame, whose yaw is `yaw` (...), rad.
    """
    step, c, s = range_m * action[..., :3], np.cos(yaw), np.sin(yaw)
    x, y, z = np.moveaxis(step, -1, 0)
    return np.asarray(position_map + np.stack([c * x - s * y, s * x + c * y, z], axis=-1))


def attitude(
    action: Array, now: ArrayLike, *, tilt_rad: float, yaw_rate_rad_s: float, ahead_s: float
) -> Array:
    """Returns attitudes (..., 4) of roll, pitch and yaw rate, the first numbers of actions.

    now: present attitudes (..., 4), whose yaw turns at the yaw rate for `ahead_s`.
    """
    roll, pitch = tilt_rad * action[..., 0], tilt_rad * action[..., 1]
    turn = ahead_s * yaw_rate_rad_s * action[..., 2]
    return rotations.from_rpy(roll, pitch, rotations.yaw_of(now) + turn)


def thrust(action: Array, hover: float, maximum: float) -> Array:
    """Returns thrusts (...) of actions (...): 0 is `hover`, -1 none, 1 twice that."""
    return np.asarray(np.minimum(hover * (1.0 + action), maximum))


def rotor_speeds(action: Array, hover: ArrayLike, maximum: float) -> Array:
    """Returns rotor speeds (..., R) of actions (..., R); hover: (R,).

    0 is the speed of hover, 1 the maximum, -1 standstill.
    """
    hover = np.asarray(hover, np.float64)
    up, down = np.maximum(action, 0.0), np.minimum(action, 0.0)
    return np.asarray(hover + (maximum - hover) * up + hover * down)
