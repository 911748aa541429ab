"""Error of an estimated trajectory: alignment in time and space, and the residual.

The rigid alignment is that of S. Umeyama, Least-squares estimation of transformation parameters
between two point patterns, IEEE PAMI 13(4), 1991, without scale; the RMSE of the residual is the
absolute trajectory error (J. Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems,
IROS 2012).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array

_RATE_HZ, _SMOOTHED = 10.0, 5
_MIN_COMMON = 0.3
_MIN_SPREAD = 1e-12


class Alignment(NamedTuple):
    """Rigid transform y = rotation x + translation."""

    rotation: Array
    """(3, 3)"""
    translation: Array
    """(3,)"""

    def apply(self, positions: Array) -> Array:
        """Returns positions (N, 3) in the other frame."""
        moved: Array = positions @ self.rotation.T + self.translation
        return moved


def umeyama(positions: Array, onto: Array) -> Alignment:
    """Returns the least-squares transform of positions (N, 3) to `onto` (N, 3)."""
    from_mean, to_mean = positions.mean(axis=0), onto.mean(axis=0)
    covariance = (onto - to_mean).T @ (positions - from_mean) / len(positions)
    u, _, vt = np.linalg.svd(covariance)
    mirror = np.ones(3)
    if np.linalg.det(u) * np.linalg.det(vt) < 0.0:
        mirror[2] = -1.0
    rotation = u @ np.diag(mirror) @ vt
    return Alignment(rotation, to_mean - rotation @ from_mean)


def ate_rmse_m(estimate: Array, truth: Array) -> float:
    """Returns the RMSE, m, of positions (N, 3) from the true ones after alignment."""
    left = umeyama(estimate, truth).apply(estimate) - truth
    return float(np.sqrt((left * left).sum(axis=1).mean()))


def at_times(time_s: Array, positions: Array, wanted_s: Array) -> Array:
    """Interpolates positions (N, 3) at increasing `time_s` (N,) to `wanted_s` (M,); (M, 3)."""
    return np.stack([np.interp(wanted_s, time_s, column) for column in positions.T], axis=1)


def common_times(one_s: Array, other_s: Array) -> NDArray[np.bool_]:
    """Returns which of the times `one_s` (N,) lie within those of `other_s`."""
    if not len(other_s):
        return np.zeros(len(one_s), np.bool_)
    within: NDArray[np.bool_] = (one_s >= other_s[0]) & (one_s <= other_s[-1])
    return within


class TimeShift(NamedTuple):
    """Time alignment of two trajectories."""

    seconds: float
    """To be added to the times of the other trajectory, s."""
    alike: float
    """Correlation of the speeds after the shift: 1 for equal ones, 0 for unrelated ones."""


def time_shift(one_s: Array, one: Array, other_s: Array, other: Array) -> TimeShift:
    """Returns the shift of the other trajectory's times that aligns both.

    It maximizes the correlation of their speeds over a second, with an overlap of at least three
    tenths of the shorter trajectory; their frames may differ.
    """
    mine, theirs = _speeds(one_s, one), _speeds(other_s, other)
    min_overlap = max(round(_MIN_COMMON * min(len(mine), len(theirs))), 3)
    best, best_lag = -np.inf, 0
    for lag in range(min_overlap - len(theirs), len(mine) - min_overlap + 1):
        a = mine[max(lag, 0) : lag + len(theirs)]
        b = theirs[max(-lag, 0) : max(-lag, 0) + len(a)]
        a, b = a - a.mean(), b - b.mean()
        spread = float(np.sqrt((a @ a) * (b @ b)))
        alike = float(a @ b) / spread if spread > _MIN_SPREAD else -1.0
        if alike > best:
            best, best_lag = alike, lag
    return TimeShift(float(one_s[0] - other_s[0]) + best_lag / _RATE_HZ, best)


def _speeds(time_s: Array, positions: Array) -> Array:
    """Returns ten speeds a second, each over the next second, smoothed over half a second."""
    times = np.arange(time_s[0], time_s[-1], 1.0 / _RATE_HZ)
    rough = at_times(time_s, positions, times)
    window = np.full(_SMOOTHED, 1.0 / _SMOOTHED)
    smooth = np.stack([np.convolve(column, window, "valid") for column in rough.T], axis=1)
    over = round(_RATE_HZ)
    speeds: Array = np.linalg.norm(smooth[over:] - smooth[:-over], axis=1)
    return speeds
