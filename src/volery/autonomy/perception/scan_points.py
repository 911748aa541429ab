"""Projects laser scans to points in the odometry frame, each beam from its pose."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.compiled import kernel
from volery.core.rotation_kernels import cross, rotate_vector
from volery.graph.messages import LaserScan, Odometry

_EXTRAPOLATED_S = 0.1
"""Longest extrapolation of a pose by its velocity: stamps of another clock may be wrong."""
_NEAREST_M = 0.45
"""Min range; nearer returns are from the vehicle itself, or noise."""


@dataclass(frozen=True)
class OdometrySample:
    """A pose (3,) m, (4,), with velocity (3,) m/s in odom and angular velocity (3,) in the body."""

    time_ns: int
    position: Array
    attitude: Array
    velocity: Array
    omega_body: Array

    @classmethod
    def from_odometry(cls, message: Odometry) -> OdometrySample:
        """Converts a message; its twist is in the body."""
        p, q = message.pose.pose.position, message.pose.pose.orientation
        v, w = message.twist.twist.linear, message.twist.twist.angular
        attitude = np.array([q.x, q.y, q.z, q.w])
        stamp = message.header.stamp
        return cls(
            stamp.sec * 1_000_000_000 + stamp.nanosec,
            np.array([p.x, p.y, p.z]),
            attitude,
            rotations.rotate(attitude, [v.x, v.y, v.z]),
            np.array([w.x, w.y, w.z]),
        )

    def position_at(self, now_ns: int) -> Array:
        """Returns the position (3,) m a moment later, extrapolated by the velocity."""
        age_s = min(max((now_ns - self.time_ns) / NS_PER_S, 0.0), _EXTRAPOLATED_S)
        return self.position + self.velocity * age_s

    @property
    def yaw(self) -> float:
        """Heading, rad."""
        return float(rotations.yaw_of(self.attitude))


class ScanProjector:
    """Projects the scans of one LIDAR at `mount` (3,) in the body, its axes along the body's."""

    def __init__(
        self, mount: Sequence[float], max_range_m: float = 15.0, keep_every: int = 2
    ) -> None:
        self._mount = np.array(mount, dtype=np.float64)
        self._max_range_m = max_range_m
        self._every = keep_every

    def points(
        self, scan: LaserScan, pose: OdometrySample, joint: tuple[int, float, float] = (0, 0.0, 0.0)
    ) -> Array:
        """Returns points (K, 3) m within range.

        `joint` is stamp (ns), angle (rad) and rate (rad/s) of a nodding mount, positive downward.
        """
        stamp = scan.header.stamp.sec * 1_000_000_000 + scan.header.stamp.nanosec
        points = np.empty((len(scan.ranges) // self._every + 1, 3))
        count = _project(
            scan.ranges,
            self._every,
            self._max_range_m,
            scan.angle_min,
            scan.angle_increment,
            scan.time_increment,
            joint[1],
            joint[2],
            (stamp - joint[0]) * 1e-9,
            (stamp - pose.time_ns) * 1e-9,
            self._mount,
            pose.position,
            pose.attitude,
            pose.velocity,
            pose.omega_body,
            points,
        )
        return points[:count]


@kernel
def _project(
    ranges: NDArray[np.float32],
    every: int,
    max_range: float,
    angle_min: float,
    angle_increment: float,
    time_increment: float,
    tilt: float,
    tilt_rate: float,
    since_joint: float,
    since_pose: float,
    mount: Array,
    position: Array,
    attitude: Array,
    velocity: Array,
    omega: Array,
    points: Array,
) -> int:
    """Fills `points`, returns their number; the rotation since the pose is to first order."""
    count = 0
    for beam in range(0, len(ranges), every):
        distance = ranges[beam]
        if not _NEAREST_M < distance < max_range:
            continue
        angle = angle_min + beam * angle_increment
        delay = beam * time_increment
        x, y = distance * math.cos(angle), distance * math.sin(angle)
        nod = tilt + tilt_rate * (since_joint + delay)
        bx = math.cos(nod) * x + mount[0]
        by = y + mount[1]
        bz = -math.sin(nod) * x + mount[2]
        t = since_pose + delay
        tx, ty, tz = cross(omega[0] * t, omega[1] * t, omega[2] * t, bx, by, bz)
        mx, my, mz = rotate_vector(
            attitude[0], attitude[1], attitude[2], attitude[3], bx + tx, by + ty, bz + tz
        )
        points[count, 0] = position[0] + velocity[0] * t + mx
        points[count, 1] = position[1] + velocity[1] * t + my
        points[count, 2] = position[2] + velocity[2] * t + mz
        count += 1
    return count
