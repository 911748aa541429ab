"""Stationarity: its detection by the IMU, and the corrections that it allows."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

import numpy as np

from volery.autonomy.slam.inertial_kernels import BG, STATE_NUMBERS, STATES, G, P, Q, V, observe
from volery.autonomy.slam.keyframes import Level, turn_of_heading
from volery.autonomy.slam.settings import GRAVITY_M_S2, ImuNoise
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S

_STILL = 100
"""Number of samples that the detection uses: 0.5 s at 200 Hz."""
_SETTLING = 2_000
"""Number of samples over which a rotation before the start is tracked: 10 s at 200 Hz."""
_STILL_GYRO, _STILL_ACCEL = 0.02, 0.25
"""Max standard deviation of samples at rest, rad/s, m/s^2: four times the ADIS16448's."""


class StationaryDetector:
    """Holds the newest IMU samples, and the rotation before the vehicle first stands still."""

    def __init__(self) -> None:
        self._newest: deque[tuple[Array, Array]] = deque(maxlen=_STILL)
        self._turns: deque[tuple[int, Array]] = deque(maxlen=_SETTLING)
        """Times, ns, and angular velocities before the start."""

    def add(self, gyro: Array, accel: Array) -> None:
        """Adds a sample, rad/s and m/s^2, body axes."""
        self._newest.append((gyro, accel))

    def add_turn(self, time_ns: int, gyro: Array) -> None:
        """Adds an angular velocity for `turned_before`."""
        self._turns.append((time_ns, gyro))

    def forget(self) -> None:
        """Clears the samples."""
        self._newest.clear()

    def is_quiet(self) -> bool:
        """Returns whether the newest samples are those of a standing or hovering vehicle."""
        if len(self._newest) < _STILL:
            return False
        gyro = np.array([reading[0] for reading in self._newest])
        accel = np.array([reading[1] for reading in self._newest])
        return bool(
            gyro.std(axis=0).max() < _STILL_GYRO
            and accel.std(axis=0).max() < _STILL_ACCEL
            and abs(np.linalg.norm(accel.mean(axis=0)) - GRAVITY_M_S2) < 1.0
            and np.linalg.norm(gyro.mean(axis=0)) < 0.1
        )

    def mean_gyro(self) -> Array:
        """Returns the mean angular velocity (3,), rad/s."""
        return np.asarray(np.mean([reading[0] for reading in self._newest], axis=0))

    def mean_accel(self) -> Array:
        """Returns the mean specific force (3,), m/s^2, which points up."""
        return np.asarray(np.mean([reading[1] for reading in self._newest], axis=0))

    def turned_before(self) -> Array:
        """Returns the rotation since the first sample, (4,) in body axes."""
        if len(self._turns) == _SETTLING:
            return rotations.IDENTITY.copy()
        bias = np.mean([reading[0] for reading in list(self._newest)[_STILL // 2 :]], axis=0)
        turned = rotations.IDENTITY.copy()
        for (before, first), (after, last) in pairwise(self._turns):
            turn = (0.5 * (first + last) - bias) * ((after - before) / NS_PER_S)
            turned = rotations.multiply(turned, rotations.exponential(turn))
        self._turns.clear()
        return turned


def first_state(start: Array, up: Array, settling: Array) -> Array:
    """Returns the state (19,) of a vehicle at rest at `start` (4,) with specific force `up` (3,).

    `settling` (4,): rotation, in body axes, since the yaw was that of `start`.
    """
    roll = math.atan2(up[1], up[2])
    pitch = math.atan2(-up[0], math.hypot(up[1], up[2]))
    attitude = rotations.from_rpy(roll, pitch, 0.0)
    heading = turn_of_heading(Level(rotations.IDENTITY, 0.0), attitude, settling)
    state = np.zeros(STATE_NUMBERS)
    state[P : P + 3] = start[:3]
    state[Q : Q + 4] = rotations.from_rpy(roll, pitch, float(start[3]) + heading)
    state[G + 2] = -GRAVITY_M_S2
    return state


def first_covariance(noise: ImuNoise, turn: Array) -> Array:
    """Returns the covariance (17, 17) of a `first_state` with attitude matrix `turn` (3, 3)."""
    sigma = np.array(
        [1e-3] * 3 + [0.01] * 3 + [1e-4] * 3
        + [noise.gyro_turn_on_rad_s] * 3 + [noise.accel_turn_on_m_s2] * 3 + [2e-3] * 2
    )  # fmt: skip
    mixing = np.eye(STATES)
    mixing[15, 12:15] = turn[1] / GRAVITY_M_S2  # a bias looks like a tilt
    mixing[16, 12:15] = -turn[0] / GRAVITY_M_S2
    spread = mixing * sigma
    return np.asarray(spread @ spread.T)


def hold_still(state: Array, covariance: Array, gyro: Array, noise: ImuNoise) -> None:
    """Applies zero velocity, and the mean rate `gyro` (3,) as the gyroscope's bias."""
    for i in range(3):
        row = np.zeros(STATES)
        row[3 + i] = 1.0
        observe(state, covariance, row, -float(state[V + i]), 0.01**2)
        row = np.zeros(STATES)
        row[9 + i] = 1.0
        innovation = float(gyro[i] - state[BG + i])
        observe(state, covariance, row, innovation, 10.0 * noise.gyro_rad_s_sqrt_hz**2)
