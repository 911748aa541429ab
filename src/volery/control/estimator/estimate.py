"""Outputs of the filters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array


class Estimate(NamedTuple):
    """Views of the present estimates of N UAVs, at the centre of mass."""

    position_map: Array
    """(N, 3) m, map frame."""
    velocity_map: Array
    """(N, 3) m/s, map frame."""
    attitude: Array
    """(N, 4) unit quaternions, map from body."""
    omega_body: Array
    """(N, 3) rad/s, FLU, corrected by the gyroscope's bias."""
    gyro_bias: Array
    """(N, 3) rad/s, body axes."""
    accel_bias: Array
    """(N, 3) m/s^2, body axes."""


class InnovationGate(NamedTuple):
    """Statistics of one aiding source since the start, rows of N UAVs."""

    innovation: Array
    """(N,) latest normalised squared innovation, fused or not."""
    accepted: NDArray[np.int64]
    """(N,) number of fused measurements."""
    rejected: NDArray[np.int64]
    """(N,) number of rejected measurements."""
