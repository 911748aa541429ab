"""Recent poses of a vehicle and angles of its nodding mount, to place each beam."""

from __future__ import annotations

from bisect import bisect_right
from typing import NamedTuple

import numpy as np

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.perception.stuck_sensors import is_stuck
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.vectors import norm
from volery.graph.messages import JointState, stamp_of

_KEPT = 64
"""Number of stored poses and angles: more than a second of each."""
_JUMP_BACK_NS = NS_PER_S // 2
"""Step back in stamps from which the clock has been set back; a smaller one is disorder."""


class Pose(NamedTuple):
    """Pose of a body: position (3,) m, attitude (4,) x y z w."""

    position: Array
    attitude: Array


class MotionHistory:
    """Stores poses by time; refuses those that are not finite, old, repeated or stuck."""

    def __init__(self) -> None:
        self._times: list[int] = []
        self._poses: list[OdometrySample] = []
        self.refused = 0

    @property
    def newest(self) -> OdometrySample | None:
        """The pose with the latest stamp, or None."""
        return self._poses[-1] if self._poses else None

    def add(self, pose: OdometrySample) -> bool:
        """Adds a pose; returns False if it is refused.

        A clock that is set back clears the stored poses.
        """
        values = (pose.position, pose.attitude, pose.velocity, pose.omega_body)
        finite = all(np.isfinite(value).all() for value in values)
        if not finite or abs(norm(pose.attitude) - 1.0) > 0.01:
            self.refused += 1
            return False
        if self._times and pose.time_ns < self._times[-1] - _JUMP_BACK_NS:
            self._times, self._poses = [], []
        if self._times and (pose.time_ns <= self._times[-1] or is_stuck(pose, self._poses[-1])):
            self.refused += 1
            return False
        self._times.append(pose.time_ns)
        self._poses.append(pose)
        del self._times[:-_KEPT], self._poses[:-_KEPT]
        return True

    def at(self, time_ns: int, ahead_s: float = 0.25, gap_s: float = 0.5) -> Pose | None:
        """Returns the pose at `time_ns`; None if it is unknown.

        It interpolates between two poses at most `gap_s` apart, and extrapolates the newest one by
        its velocities for at most `ahead_s`.
        """
        row = bisect_right(self._times, time_ns) - 1
        if row < 0:
            return None
        before = self._poses[row]
        since = (time_ns - before.time_ns) / NS_PER_S
        if row + 1 == len(self._poses):
            return _carried_on(before, since) if since <= ahead_s else None
        after = self._poses[row + 1]
        between = (after.time_ns - before.time_ns) / NS_PER_S
        if between > gap_s:
            return None
        fraction = since / between
        turned = after.attitude * (1.0 if before.attitude @ after.attitude >= 0.0 else -1.0)
        return Pose(
            before.position + fraction * (after.position - before.position),
            rotations.normalize(before.attitude + fraction * (turned - before.attitude)),
        )


def _carried_on(pose: OdometrySample, seconds: float) -> Pose:
    turn = rotations.exponential(pose.omega_body * seconds)
    return Pose(
        pose.position + pose.velocity * seconds,
        rotations.normalize(rotations.multiply(pose.attitude, turn)),
    )


class NodHistory:
    """Stores angles (rad, positive down) of a nodding mount by time, with their rates (rad/s)."""

    def __init__(self) -> None:
        self._times: list[int] = []
        self._angles: list[tuple[float, float]] = []
        self.refused = 0

    def add(self, time_ns: int, angle: float, rate: float) -> bool:
        """Adds an angle; returns False if it is not finite, or not newer than the newest."""
        if not (np.isfinite(angle) and np.isfinite(rate)):
            self.refused += 1
            return False
        if self._times and time_ns < self._times[-1] - _JUMP_BACK_NS:
            self._times, self._angles = [], []
        if self._times and time_ns <= self._times[-1]:
            self.refused += 1
            return False
        self._times.append(time_ns)
        self._angles.append((angle, rate))
        del self._times[:-_KEPT], self._angles[:-_KEPT]
        return True

    def add_message(self, message: JointState) -> None:
        """Adds the angle in a message of the nodding mount; ignores those of other joints."""
        if len(message.name) and message.name[0] == "laser_nodding" and len(message.velocity):
            self.add(stamp_of(message), float(message.position[0]), float(message.velocity[0]))

    def at(self, time_ns: int, ahead_s: float = 0.25) -> float | None:
        """Returns the angle at `time_ns`: interpolated, or extrapolated by at most `ahead_s`."""
        row = bisect_right(self._times, time_ns) - 1
        if row < 0:
            return None
        angle, rate = self._angles[row]
        since = (time_ns - self._times[row]) / NS_PER_S
        if row + 1 < len(self._times):
            between = (self._times[row + 1] - self._times[row]) / NS_PER_S
            return angle + since / between * (self._angles[row + 1][0] - angle)
        return angle + since * rate if since <= ahead_s else None
