"""Initial estimates: ground truth with random errors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.control.estimator.settings import StartSigmas
from volery.core import rng, rotations
from volery.core.arrays import Array

_NUMBERS = 9


def drawn_start(
    keys: NDArray[np.uint64],
    position: Array,
    velocity: Array,
    attitude: Array,
    sigmas: StartSigmas,
) -> tuple[Array, Array, Array]:
    """Returns initial estimates of position, velocity (S, 3) and attitude (S, 4) of S UAVs.

    position, velocity, attitude: the true ones. keys: (S,) random streams. The errors are normal,
    with the standard deviations of `sigmas`.
    """
    draws = np.empty((len(keys), _NUMBERS))
    rng.fill_normal(keys, 0, draws)
    tilt = np.array([sigmas.tilt_rad, sigmas.tilt_rad, sigmas.heading_rad]) * draws[:, 6:]
    turn = rotations.exponential(tilt)
    return (
        position + np.array(sigmas.position_m) * draws[:, :3],
        velocity + np.array(sigmas.velocity_m_s) * draws[:, 3:6],
        rotations.multiply(turn, attitude),
    )
