"""Builds the messages of the SLAM nodes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from volery.autonomy.slam.linear import block
from volery.core import rotations
from volery.core.arrays import Array
from volery.graph.messages import (
    Odometry,
    PathMessage,
    Point,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Twist,
    TwistWithCovariance,
    Vector3,
    header,
    message_type,
)

_OF_POSE = np.array([0, 1, 2, 6, 7, 8])
POSE = message_type("geometry_msgs/msg/PoseWithCovarianceStamped")


def _pose(position: Array, attitude: Array) -> Pose:
    return Pose(Point(*map(float, position)), Quaternion(*map(float, attitude)))


def _matrix(covariance: Array) -> Array:
    """Returns a covariance (6, 6) flattened and read-only, as messages hold it."""
    flat = np.ascontiguousarray(covariance).reshape(36)
    flat.flags.writeable = False
    return flat


def odometry(
    time_ns: int, uav: str, state: tuple[Array, Array, Array, Array], covariance: Array
) -> Odometry:
    """Returns odometry of position (3,), attitude (4,), velocity (3,) in `uavN/odom`.

    The fourth part of `state` is the angular velocity (3,) in the body. `covariance` (9, 9) is of
    position, velocity and attitude, about the frame's axes.
    """
    position, attitude, velocity, omega = state
    of_pose = block(covariance, _OF_POSE)
    turn = rotations.matrix(attitude).T
    of_twist = np.zeros((6, 6))
    of_twist[:3, :3] = turn @ covariance[3:6, 3:6] @ turn.T
    linear = rotations.rotate(rotations.conjugate(attitude), velocity)
    return Odometry(
        header(time_ns, f"{uav}/odom"),
        f"{uav}/base_link",
        PoseWithCovariance(_pose(position, attitude), _matrix(of_pose)),
        TwistWithCovariance(
            Twist(Vector3(*map(float, linear)), Vector3(*map(float, omega))), _matrix(of_twist)
        ),
    )


def pose_in_map(time_ns: int, position: Array, attitude: Array, sigmas: Array) -> object:
    """Returns a pose in the map.

    `sigmas` (6,): of x, y, z, m, and of rotations about the map's axes, rad.
    """
    return POSE(
        header(time_ns, "map"),
        PoseWithCovariance(_pose(position, attitude), _matrix(np.diag(sigmas**2))),
    )


def map_from_odom(time_ns: int, uav: str, position: Array, attitude: Array) -> TFMessage:
    """Returns the transform `map -> uavN/odom`."""
    transform = Transform(Vector3(*map(float, position)), Quaternion(*map(float, attitude)))
    return TFMessage([TransformStamped(header(time_ns, "map"), f"{uav}/odom", transform)])


def path(time_ns: int, times_ns: Sequence[int], poses: Sequence[Array]) -> PathMessage:
    """Returns the path of the keyframes' poses (4,) x, y, z, yaw in the map."""
    stamped = []
    for when, (x, y, z, yaw) in zip(times_ns, poses, strict=True):
        turn = Quaternion(0.0, 0.0, math.sin(0.5 * float(yaw)), math.cos(0.5 * float(yaw)))
        point = Point(float(x), float(y), float(z))
        stamped.append(PoseStamped(header(when, "map"), Pose(point, turn)))
    return PathMessage(header(time_ns, "map"), stamped)
