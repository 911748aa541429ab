"""Converts trajectory_msgs/MultiDOFJointTrajectory to trajectory commands."""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.control.trajectory import Trajectory
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.errors import CommandError
from volery.graph.messages import frame_of
from volery.runtime.vehicles.uav import Uav


def follow_message(uav: Uav, message: Any) -> None:
    """Commands `uav` by a MultiDOFJointTrajectory, whose first joint is the vehicle.

    One point at time 0 is a trajectory setpoint; else the UAV flies the points from now on and
    ignores the stamp. Transforms, velocities and accelerations are those of `base_link` in `map`;
    yaw comes from the rotations. Raises `CommandError`, also for another frame.
    """
    if frame_of(message) not in ("", "map"):
        raise CommandError(f"trajectories are in 'map', not in '{frame_of(message)}'")
    points = message.points
    if not len(points) or not all(len(point.transforms) for point in points):
        raise CommandError("a trajectory needs points, each with a transform")
    times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in points]
    position = np.array([_vector(p.transforms[0].translation) for p in points])
    yaw = np.array([_yaw(p.transforms[0].rotation) for p in points])
    velocity = _of_all([p.velocities for p in points], "linear")
    acceleration = _of_all([p.accelerations for p in points], "linear")
    turn = _of_all([p.velocities for p in points], "angular")
    yaw_rate = None if turn is None else turn[:, 2]
    if len(points) > 1 or times[0] > 0.0:
        if len(points) == 1:  # reached from the present motion, and held there
            times, position, yaw = _held(times, position, yaw)
            velocity = acceleration = yaw_rate = None
        uav.follow_trajectory(
            Trajectory.from_samples(times, position, velocity, acceleration, yaw, yaw_rate)
        )
        return
    rest = np.zeros((1, 3))
    uav.command_setpoint(
        position[0],
        (rest if velocity is None else velocity)[0],
        (rest if acceleration is None else acceleration)[0],
        float(yaw[0]),
        0.0 if yaw_rate is None else float(yaw_rate[0]),
    )


def _held(times: list[float], position: Array, yaw: Array) -> tuple[list[float], Array, Array]:
    return [times[0], times[0] + 0.1], np.repeat(position, 2, axis=0), np.repeat(yaw, 2)


def _of_all(parts: list[Any], name: str) -> Array | None:
    """Returns vectors (K, 3) of the first joint, or None if some point lacks one."""
    if not all(len(part) for part in parts):
        return None
    return np.array([_vector(getattr(part[0], name)) for part in parts])


def _vector(message: Any) -> list[float]:
    return [message.x, message.y, message.z]


def _yaw(message: Any) -> float:
    q = np.array([message.x, message.y, message.z, message.w], dtype=np.float64)
    yaw = rotations.heading_of(q) if 0.9 <= float(np.linalg.norm(q)) <= 1.1 else None
    if yaw is None:
        raise CommandError("rotations of a trajectory must be unit quaternions")
    return yaw
