"""Starts: motions of the UAVs of environments (R,) at the beginning of episodes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array
from volery.learning.flight import Flight


def positions_in_box(
    flight: Flight, envs: NDArray[np.int64], low: tuple[float, ...], high: tuple[float, ...]
) -> Array:
    """Draws positions (R, n, 3), m, between two corners of a box."""
    return flight.draws.uniform(envs, low, high, (flight.num_uavs, 3))


def vectors_in_ball(flight: Flight, envs: NDArray[np.int64], radius: float) -> Array:
    """Draws vectors (R, n, 3), uniformly in a ball."""
    direction = flight.draws.normal(envs, 1.0, (flight.num_uavs, 3))
    length = radius * flight.draws.uniform(envs, shape=(flight.num_uavs, 1)) ** (1.0 / 3.0)
    return np.asarray(length * direction / np.linalg.norm(direction, axis=-1, keepdims=True))


def tilted_attitudes(flight: Flight, envs: NDArray[np.int64], tilt_rad: float) -> Array:
    """Draws attitudes (R, n, 4): any heading, tilted by up to `tilt_rad` in any direction."""
    yaw, axis, tilt = np.moveaxis(
        flight.draws.uniform(
            envs, [-math.pi, -math.pi, 0.0], [math.pi, math.pi, tilt_rad], (flight.num_uavs, 3)
        ),
        -1,
        0,
    )
    lean = np.stack(
        [
            np.sin(tilt / 2.0) * np.cos(axis),
            np.sin(tilt / 2.0) * np.sin(axis),
            np.zeros_like(tilt),
            np.cos(tilt / 2.0),
        ],
        axis=-1,
    )
    turn = np.stack([0.0 * yaw, 0.0 * yaw, np.sin(yaw / 2.0), np.cos(yaw / 2.0)], axis=-1)
    return rotations.multiply(lean, turn)
