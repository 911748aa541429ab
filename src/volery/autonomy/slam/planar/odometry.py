"""Buffers poses of a wheel odometry by time."""

from __future__ import annotations

import math
from bisect import bisect_right

import numpy as np

from volery.autonomy.slam.planar.poses import between, compose
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import Odometry, stamp_of

_KEPT = 512
_JUMP_BACK_NS = NS_PER_S // 2
_LATE_NS, _GAP_NS = NS_PER_S // 4, 5 * NS_PER_S
_MAX_M_S, _MAX_RAD_S = 20.0, 20.0
"""Speeds above which a step is a reset of the odometry."""


class WheelOdometry(SavedAttributes):
    """Holds recent poses; ignores poses that are not finite, late or repeated."""

    STATE = ("_times", "_poses", "refused")

    def __init__(self) -> None:
        self._times: list[int] = []
        self._poses: list[Array] = []
        self.refused = 0

    @property
    def newest_ns(self) -> int | None:
        """Time of the newest pose, ns; None: no pose."""
        return self._times[-1] if self._times else None

    def add(self, message: Odometry) -> None:
        """Adds a pose."""
        p, q = message.pose.pose.position, message.pose.pose.orientation
        numbers = np.array([p.x, p.y, q.x, q.y, q.z, q.w])
        time_ns = stamp_of(message)
        if not np.isfinite(numbers).all() or not np.any(numbers[2:]):
            self.refused += 1
            return
        if self._times and time_ns < self._times[-1] - _JUMP_BACK_NS:
            self._times, self._poses = [], []  # the clock was set back
        if self._times and time_ns <= self._times[-1]:
            self.refused += 1
            return
        self._times.append(time_ns)
        self._poses.append(np.array([p.x, p.y, float(rotations.yaw_of(numbers[2:]))]))
        del self._times[:-_KEPT], self._poses[:-_KEPT]

    def at(self, time_ns: int) -> Array | None:
        """Returns the pose (3,) at a time, interpolated; None if it is unknown."""
        row = bisect_right(self._times, time_ns) - 1
        if row < 0:
            return None
        since = time_ns - self._times[row]
        if row + 1 == len(self._times):
            return self._poses[row] if since <= _LATE_NS else None
        gap = self._times[row + 1] - self._times[row]
        if gap > _GAP_NS:
            return None
        step = between(self._poses[row], self._poses[row + 1])
        return compose(self._poses[row], step * (since / gap))


def step_between(one: Array | None, other: Array | None, dt: float) -> Array | None:
    """Returns the step (3,) between two poses `dt` s apart; None if unknown or implausible."""
    if one is None or other is None:
        return None
    step = between(one, other)
    max_s = max(dt, 0.02)
    if math.hypot(step[0], step[1]) > _MAX_M_S * max_s or abs(step[2]) > _MAX_RAD_S * max_s:
        return None
    return step
