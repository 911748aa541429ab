"""Converts local plans to messages and back."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.planning.primitives import PrimitivePath
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S, ns_from_s
from volery.graph.messages import (
    MultiDOFJointTrajectory,
    MultiDOFJointTrajectoryPoint,
    Quaternion,
    Transform,
    Twist,
    Vector3,
    header,
    message_type,
    stamp_of,
)

_STEP_S = 0.2
"""Time between samples; the velocity is linear between them."""
_DURATION: type[Any] = message_type("builtin_interfaces/msg/Duration")
_NO_TURN = Vector3(0.0, 0.0, 0.0)


class TrajectorySamples(NamedTuple):
    """Samples of a trajectory, in one frame."""

    time_ns: NDArray[np.int64]
    """(K,) increasing, K > 0."""
    position: Array
    velocity: Array
    """(K, 3) m, m/s."""
    yaw: float
    """Wanted heading, rad."""

    def at(self, time_ns: int) -> tuple[Array, Array]:
        """Returns position and velocity (3,): extrapolated before the start, at rest at the end."""
        if time_ns >= self.time_ns[-1]:
            return self.position[-1], np.zeros(3)
        row = max(bisect_right(self.time_ns, time_ns) - 1, 0)
        if time_ns <= self.time_ns[0]:
            back = (int(self.time_ns[0]) - time_ns) / NS_PER_S
            return self.position[0] - back * self.velocity[0], self.velocity[0]
        span = int(self.time_ns[row + 1] - self.time_ns[row]) / NS_PER_S
        fraction = (time_ns - int(self.time_ns[row])) / NS_PER_S / span
        v0, v1 = self.velocity[row], self.velocity[row + 1]
        velocity = v0 + fraction * (v1 - v0)
        return self.position[row] + fraction * span * 0.5 * (v0 + velocity), velocity


def trajectory_message(
    path: PrimitivePath, yaw: float, frame_id: str, begins_ns: int
) -> MultiDOFJointTrajectory:
    """Returns a plan as trajectory_msgs/MultiDOFJointTrajectory, stamped with its start."""
    turn = Quaternion(0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
    count = math.ceil(path.duration_s / _STEP_S)
    points = []
    for k in range(count + 1):
        time = min(k * _STEP_S, path.duration_s)
        state = path.at(time)
        sec, nanosec = divmod(ns_from_s(time), NS_PER_S)
        points.append(
            MultiDOFJointTrajectoryPoint(
                [Transform(Vector3(*state.position.tolist()), turn)],
                [Twist(Vector3(*state.velocity.tolist()), _NO_TURN)],
                [Twist(Vector3(*state.acceleration.tolist()), _NO_TURN)],
                _DURATION(sec, nanosec),
            )
        )
    return MultiDOFJointTrajectory(header(begins_ns, frame_id), ["base_link"], points)


def samples_of(message: MultiDOFJointTrajectory) -> TrajectorySamples | None:
    """Returns a message's samples; None if it has none, or if values are not finite."""
    points = message.points
    if not points or not all(len(p.transforms) and len(p.velocities) for p in points):
        return None
    begin = stamp_of(message)
    times = [p.time_from_start.sec * NS_PER_S + p.time_from_start.nanosec for p in points]
    position = np.array([_vector(p.transforms[0].translation) for p in points])
    velocity = np.array([_vector(p.velocities[0].linear) for p in points])
    q = points[-1].transforms[0].rotation
    yaw = rotations.heading_of((q.x, q.y, q.z, q.w)) or 0.0
    finite = np.isfinite(position).all() and np.isfinite(velocity).all() and math.isfinite(yaw)
    if not finite or (np.diff(times) <= 0).any():
        return None
    return TrajectorySamples(begin + np.array(times, np.int64), position, velocity, yaw)


def _vector(message: Any) -> list[float]:
    return [message.x, message.y, message.z]
