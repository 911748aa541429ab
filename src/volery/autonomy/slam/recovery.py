"""Recovers attitude and position after a gap in the IMU data."""

from __future__ import annotations

import math

import numpy as np

from volery.autonomy.slam.inertial_kernels import BA, BG, STATES, G, P, Q, V, move, observe
from volery.autonomy.slam.local_maps import Submaps
from volery.autonomy.slam.matching_kernels import carry_along
from volery.autonomy.slam.recovery_kernels import find_attitude, find_position
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S

GAP_S = 0.05
"""Duration of motion that an IMU sample covers; the motion after it is unknown."""
_LONGEST_STEP_S = 0.1
_UNKNOWN_TURN, _UNKNOWN_PUSH = 0.4, 2.0
"""Noise densities of rates and accelerations in a gap, about zero, rad/s and m/s^2 over root Hz.

A UAV without a collision rotates by 0.3 rad in half a second, and gains 1.4 m/s (modelling
choices).
"""
_UNSURE_RAD = 0.05
"""Tilt uncertainty above which ground returns would be classified as upright."""
_TRIED_RAD, _TRIED, _ATTITUDE_FRACTION = 0.6, 400, 0.75
"""Max rotation that is tried, number of returns, and fraction of them that must fit."""
_FOUND_RAD, _FOUND_M = 0.03, 0.15
"""Standard deviations of the recovered pose."""
_MIN_M, _MAX_M, _MIN_RAD, _MAX_RAD = 0.5, 3.0, 0.2, 0.8
"""Bounds of the search window of three standard deviations."""
_POSITION_FRACTION, _ELSEWHERE = 0.35, 0.75
"""Min fraction of matched uprights, and max fraction elsewhere, relative to it."""
_LONG_NS = NS_PER_S
_USUAL_M_S, _USUAL_EACH_NS = 2.5, NS_PER_S // 2
"""Typical speed of a UAV, applied as a velocity measurement at this period (modelling choices)."""


class Recovery:
    """State of a recovery, from a gap in the IMU data to its end.

    Meanwhile sweeps are neither inserted nor matched.
    """

    def __init__(self, since_ns: int | None = None) -> None:
        """Starts a recovery at `since_ns` with empty maps; None: tracking is intact."""
        self.since_ns = since_ns
        """Start of the recovery, ns; None: tracking is intact."""
        self._has_maps = since_ns is None
        self.gap = 0, 0
        """Start and end of the last gap, ns."""
        self._before = np.zeros((0, 3))
        """Returns of the previous sweep, (K, 3) m in the frame."""
        self._upright_ns = since_ns or 0

    @staticmethod
    def is_aslant(covariance: Array) -> bool:
        """Returns whether the tilt is too uncertain to tell ground from uprights."""
        return bool(max(covariance[6, 6], covariance[7, 7]) > _UNSURE_RAD**2)

    def coast(
        self, state: Array, covariance: Array, span: tuple[int, int], dt: float, noise: Array
    ) -> None:
        """Predicts the state over `dt` s of a gap: constant velocity and attitude."""
        noise = np.array([_UNKNOWN_TURN, _UNKNOWN_PUSH, *noise[2:]])
        while dt > 0.0:
            step = min(dt, _LONGEST_STEP_S)
            back = rotations.conjugate(state[Q : Q + 4])
            gyro = state[BG : BG + 3].copy()
            accel = rotations.rotate(back, -state[G : G + 3]) + state[BA : BA + 3]
            move(state, covariance, gyro, accel, step, noise)
            dt -= step
        self.gap = span
        if self.since_ns is None and self.is_aslant(covariance):
            self.since_ns = self._upright_ns = span[1]
            self._before = np.zeros((0, 3))

    def keep_upright(self, state: Array, covariance: Array, time_ns: int) -> None:
        """Limits the velocity: a wrong tilt would appear as a lasting acceleration."""
        if self.since_ns is None or time_ns - self._upright_ns < _USUAL_EACH_NS:
            return
        self._upright_ns = time_ns
        if self.is_aslant(covariance):
            for i in range(V, V + 3):
                row = np.zeros(STATES)
                row[i] = 1.0
                observe(state, covariance, row, -float(state[i]), _USUAL_M_S**2)

    def has_failed(self, covariance: Array, now_ns: int) -> bool:
        """Returns whether tilt has been known, but the position not found, for too long."""
        if self.since_ns is None or self.is_aslant(covariance):
            return False
        return self._has_maps and now_ns - self.since_ns > _LONG_NS

    def is_in_gap(self, first_ns: int, last_ns: int) -> bool:
        """Returns whether an interval overlaps the last gap."""
        return first_ns < self.gap[1] and last_ns > self.gap[0]

    def find(
        self, state: Array, covariance: Array, states: Array, maps: Submaps, points: Array
    ) -> bool:
        """Rotates and moves the state so that returns (K, 3) of the body fit the map.

        Returns whether it succeeded. Earlier `states` (M, 19) move along.
        """
        if not self._has_maps:
            if not self.is_aslant(covariance):
                self.since_ns = None
            return self.since_ns is None
        moved = rotations.rotate(state[Q : Q + 4], points) + state[:3]
        before, self._before = self._before, moved
        if not len(before):
            return False
        both = np.concatenate([before, moved])
        body = rotations.rotate(rotations.conjugate(state[Q : Q + 4]), both - state[:3])
        tried = state.copy()
        if self.is_aslant(covariance):
            few = np.ascontiguousarray(body[:: max(len(body) // _TRIED, 1)])
            fraction = find_attitude(tried, few, maps, _TRIED_RAD)
            if fraction < _ATTITUDE_FRACTION:
                return False
        if not _find_position(tried, covariance, maps, body):
            return False
        was = state.copy()
        state[:] = tried
        carry_along(states, was, state)
        for at, sigma in ((slice(0, 2), _FOUND_M), (slice(6, 9), _FOUND_RAD)):
            covariance[at] = covariance[:, at] = 0.0
            covariance[at, at] = np.eye(at.stop - at.start) * sigma**2
        self.since_ns = None
        return True


def _find_position(state: Array, covariance: Array, maps: Submaps, body: Array) -> bool:
    """Moves `state` to the best match of the uprights; returns whether it is unique."""
    spread = 3.0 * math.sqrt(float(max(covariance[0, 0], covariance[1, 1])))
    turn = 3.0 * math.sqrt(float(covariance[8, 8]))
    found = np.zeros(5)
    find_position(
        rotations.rotate(state[Q : Q + 4], body) + state[:3],
        state[P : P + 3].copy(), maps,
        min(max(spread, _MIN_M), _MAX_M), min(max(turn, _MIN_RAD), _MAX_RAD), found,
    )  # fmt: skip
    if found[3] < _POSITION_FRACTION or found[4] > _ELSEWHERE * found[3]:
        return False
    state[P : P + 2] += found[:2]
    around = rotations.from_yaw(float(found[2]))
    state[Q : Q + 4] = rotations.multiply(around, state[Q : Q + 4])
    return True
