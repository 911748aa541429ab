"""What a motion of which no reading told leaves open, and how it is found out."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.inertial_kernels import BA, BG, STATES, G, P, Q, V, move, observe
from volery.autonomy.slam.local_maps import Submaps
from volery.autonomy.slam.matching_kernels import carry_along
from volery.autonomy.slam.recovery_kernels import find_attitude, find_place
from volery.core import rotations
from volery.core.clock import NS_PER_S

Array = NDArray[np.float64]

GAP_S = 0.05
"""So long a reading of the IMU tells of the motion; what comes after it is not known."""
_LONGEST_STEP_S = 0.1
_UNKNOWN_TURN, _UNKNOWN_PUSH = 0.4, 2.0
"""Of such a motion: densities of rates and accelerations about none, rad/s and m/s^2 over root Hz.

A UAV that is not hit turns by 0.3 rad in half a second, and gains 1.4 m/s (modelling choices).
"""
_UNSURE_RAD = 0.05
"""Where the attitude is less sure about a level axis, ground would be taken for what stands."""
_TRIED_RAD, _TRIED, _ATTITUDE_SHARE = 0.6, 400, 0.75
"""Turns up to this are tried, with so many returns, of which this share must fit."""
_FOUND_RAD, _FOUND_M = 0.03, 0.15
"""Standard deviations of what was found."""
_LEAST_M, _MOST_M, _LEAST_RAD, _MOST_RAD = 0.5, 3.0, 0.2, 0.8
"""Places are tried within three standard deviations, within these."""
_PLACE_SHARE, _ELSEWHERE = 0.35, 0.75
"""Share of the uprights that must be met, and the most that may be elsewhere, as a part of it."""
_LONG_NS = NS_PER_S
_USUAL_M_S, _USUAL_EACH_NS = 2.5, NS_PER_S // 2
"""A UAV does not fly much faster, which so often tells where up is (modelling choices)."""


class Recovery:
    """Begins with a gap in the readings; until it has ended, nothing is drawn nor matched."""

    def __init__(self, since_ns: int | None = None) -> None:
        """`since_ns`: begin with maps that are empty, once it is known where up is."""
        self.since_ns = since_ns
        """When the motion was lost; None: it is followed."""
        self._has_maps = since_ns is None
        self.gap = 0, 0
        """Between which times the newest unknown motion lies."""
        self._before = np.zeros((0, 3))
        """Returns of the sweep before, (K, 3) m in the frame."""
        self._upright_ns = since_ns or 0

    @staticmethod
    def is_aslant(covariance: Array) -> bool:
        """Whether the attitude is not known well enough to tell ground from what stands on it."""
        return bool(max(covariance[6, 6], covariance[7, 7]) > _UNSURE_RAD**2)

    def coast(
        self, state: Array, covariance: Array, span: tuple[int, int], dt: float, noise: Array
    ) -> None:
        """Go on straight for `dt` s of a gap between two times, without a turn."""
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
        """Who believes to be aslant would gain speed, and that does not last."""
        if self.since_ns is None or time_ns - self._upright_ns < _USUAL_EACH_NS:
            return
        self._upright_ns = time_ns
        if self.is_aslant(covariance):
            for i in range(V, V + 3):
                row = np.zeros(STATES)
                row[i] = 1.0
                observe(state, covariance, row, -float(state[i]), _USUAL_M_S**2)

    def has_failed(self, covariance: Array, now_ns: int) -> bool:
        """Whether it is known where up is, but the place has not been found for long."""
        if self.since_ns is None or self.is_aslant(covariance):
            return False
        return self._has_maps and now_ns - self.since_ns > _LONG_NS

    def is_in_gap(self, first_ns: int, last_ns: int) -> bool:
        """Whether something lasted while the motion was not known."""
        return first_ns < self.gap[1] and last_ns > self.gap[0]

    def find(
        self, state: Array, covariance: Array, states: Array, maps: Submaps, points: Array
    ) -> bool:
        """Turn and move so that returns (K, 3) of the body fit the map; whether they do.

        `states` (M, 19), those before, are turned and moved along.
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
            share = find_attitude(
                tried, few, maps.ground_keys, maps.sums, maps.upright_keys, maps.cells, _TRIED_RAD
            )
            if share < _ATTITUDE_SHARE:
                return False
        if not _find_place(tried, covariance, maps, body):
            return False
        was = state.copy()
        state[:] = tried
        carry_along(states, was, state)
        for at, sigma in ((slice(0, 2), _FOUND_M), (slice(6, 9), _FOUND_RAD)):
            covariance[at] = covariance[:, at] = 0.0
            covariance[at, at] = np.eye(at.stop - at.start) * sigma**2
        self.since_ns = None
        return True


def _find_place(state: Array, covariance: Array, maps: Submaps, body: Array) -> bool:
    """Move and turn `state` to where uprights of the map are; whether that is one place."""
    spread = 3.0 * math.sqrt(float(max(covariance[0, 0], covariance[1, 1])))
    turn = 3.0 * math.sqrt(float(covariance[8, 8]))
    found = np.zeros(5)
    find_place(
        rotations.rotate(state[Q : Q + 4], body) + state[:3],
        state[P : P + 3].copy(), maps.ground_keys, maps.sums, maps.upright_keys, maps.cells,
        min(max(spread, _LEAST_M), _MOST_M), min(max(turn, _LEAST_RAD), _MOST_RAD), found,
    )  # fmt: skip
    if found[3] < _PLACE_SHARE or found[4] > _ELSEWHERE * found[3]:
        return False
    state[P : P + 2] += found[:2]
    around = rotations.from_rpy(0.0, 0.0, float(found[2]))
    state[Q : Q + 4] = rotations.multiply(around, state[Q : Q + 4])
    return True
