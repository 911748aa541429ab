"""What users see of the filters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Estimate(NamedTuple):
    """Views of what the filters believe of the present, rows of UAVs, at the centre of mass."""

    position_map: Array
    """(N, 3) m."""
    velocity_map: Array
    """(N, 3) m/s."""
    attitude: Array
    """(N, 4) unit quaternions, map from body."""
    omega_body: Array
    """(N, 3) rad/s, FLU, without the gyroscope's bias."""
    gyro_bias: Array
    """(N, 3) rad/s, body axes."""
    accel_bias: Array
    """(N, 3) m/s^2, body axes."""


class InnovationGate(NamedTuple):
    """How one aid fared since the start, rows of UAVs."""

    innovation: Array
    """(N,) the latest normalised squared innovation, fused or not."""
    accepted: NDArray[np.int64]
    """(N,)."""
    rejected: NDArray[np.int64]
    """(N,)."""
