"""From a laser scan to points in the odometry frame, each beam from where it was cast."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.graph.messages import LaserScan, Odometry

Array = NDArray[np.float64]

_NEAREST_M = 0.45
"""Nearer returns are the vehicle's own or noise."""


@dataclass(frozen=True)
class Pose:
    """Latest odometry: position (3,), attitude (4,), velocity_odom (3,), omega_body (3,)."""

    time_ns: int
    position: Array
    attitude: Array
    velocity: Array
    omega_body: Array

    @classmethod
    def from_odometry(cls, message: Odometry) -> Pose:
        """Take over a message; its twist is in the body."""
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

    @property
    def yaw(self) -> float:
        """Heading, rad."""
        return float(rotations.yaw_of(self.attitude))


class ScanProjector:
    """Projects the scans of one LIDAR at `mount` (3,) in the body, its axes along the body's."""

    def __init__(self, mount: Sequence[float], reach_m: float = 15.0, keep_every: int = 3) -> None:
        self._mount = np.array(mount, dtype=np.float64)
        self._reach = reach_m
        self._every = keep_every
        self._directions: Array | None = None

    def points(
        self, scan: LaserScan, pose: Pose | None, joint: tuple[int, float, float] | None = None
    ) -> Array | None:
        """Returns within reach as points (K, 3); None before the first odometry.

        `joint` is stamp (ns), angle (rad) and rate (rad/s) of a nodding mount, positive downward.
        """
        if pose is None:
            return None
        ranges = scan.ranges[:: self._every]
        if self._directions is None or len(self._directions) != len(ranges):
            angle = scan.angle_min + scan.angle_increment * self._every * np.arange(len(ranges))
            self._directions = np.stack(
                [np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1
            )
        keep = (ranges > _NEAREST_M) & (ranges < self._reach)
        stamp = scan.header.stamp.sec * 1_000_000_000 + scan.header.stamp.nanosec
        beam_s = (np.flatnonzero(keep) * self._every) * scan.time_increment
        sensor = self._directions[keep] * ranges[keep, None]
        if joint is not None:
            since_joint = (stamp - joint[0]) * 1e-9 + beam_s
            sensor = _tilted(sensor, np.asarray(joint[1] + joint[2] * since_joint))
        since_pose = (stamp - pose.time_ns) * 1e-9 + beam_s
        turned = rotations.exponential(pose.omega_body * since_pose[:, None])
        body = rotations.rotate(turned, sensor + self._mount)
        position = pose.position + pose.velocity * since_pose[:, None]
        return np.asarray(position + rotations.rotate(pose.attitude, body))


def _tilted(points: Array, tilt: Array) -> Array:
    """Points (K, 3) turned about y by `tilt` (K,)."""
    c, s = np.cos(tilt), np.sin(tilt)
    return np.stack(
        [c * points[:, 0] + s * points[:, 2], points[:, 1], c * points[:, 2] - s * points[:, 0]],
        axis=1,
    )
