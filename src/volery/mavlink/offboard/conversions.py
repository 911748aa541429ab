"""Converts between a UAV's topics and MAVLink: setpoints out, odometry in."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from volery.core import rotations
from volery.core.errors import GraphError
from volery.core.frames import (
    enu_of_ned,
    flu_of_frd,
    frd_of_flu,
    q_enu_flu_of_ned_frd,
    q_ned_frd_of_enu_flu,
)
from volery.graph.messages import (
    Odometry,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    Twist,
    TwistWithCovariance,
    Vector3,
    header,
)
from volery.mavlink.codec import dialect

_BODY_NED = 8
_POSITION, _ACCELERATION, _YAW = 1 | 2 | 4, 64 | 128 | 256, 1024
_IGNORE_ATTITUDE = 128
_UNKNOWN = np.zeros(36)


def velocity_setpoint(twist: Any, target: tuple[int, int], time_ms: int) -> Any:
    """Returns SET_POSITION_TARGET_LOCAL_NED of a Twist in the level heading frame."""
    linear, turn = twist.linear, twist.angular.z
    velocity = frd_of_flu((linear.x, linear.y, linear.z))
    _check((*velocity, turn))
    nothing = (0.0, 0.0, 0.0)
    return dialect().MAVLink_set_position_target_local_ned_message(
        time_ms,
        *target,
        _BODY_NED,
        _POSITION | _ACCELERATION | _YAW,
        *nothing,
        *velocity,
        *nothing,
        0.0,
        -turn,
    )


def attitude_setpoint(message: Any, target: tuple[int, int], time_ms: int) -> Any:
    """Returns SET_ATTITUDE_TARGET of a mavros AttitudeTarget, whose mask has the same bits."""
    q, w = message.orientation, message.body_rate
    x, y, z, scalar = q_ned_frd_of_enu_flu((q.x, q.y, q.z, q.w))
    rates = frd_of_flu((w.x, w.y, w.z))
    _check((x, y, z, scalar, *rates, message.thrust))
    mask = int(message.type_mask)
    attitude = [1.0, 0.0, 0.0, 0.0] if mask & _IGNORE_ATTITUDE else [scalar, x, y, z]
    return dialect().MAVLink_set_attitude_target_message(
        time_ms, *target, mask, attitude, *rates, float(message.thrust)
    )


def odometry(position: Any, attitude: Any, time_ns: int, frame: str) -> Odometry:
    """Returns odometry (ENU, FLU) of LOCAL_POSITION_NED and ATTITUDE_QUATERNION."""
    ned = (attitude.q2, attitude.q3, attitude.q4, attitude.q1)
    q = q_enu_flu_of_ned_frd(ned)
    velocity = enu_of_ned((position.vx, position.vy, position.vz))
    body = rotations.rotate(rotations.conjugate(q), velocity).tolist()
    rates = flu_of_frd((attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed))
    pose = Pose(Point(*enu_of_ned((position.x, position.y, position.z))), Quaternion(*q))
    return Odometry(
        header(time_ns, f"{frame}odom"),
        f"{frame}base_link",
        PoseWithCovariance(pose, _UNKNOWN),
        TwistWithCovariance(Twist(Vector3(*body), Vector3(*rates)), _UNKNOWN),
    )


def _check(numbers: tuple[float, ...]) -> None:
    if not all(map(math.isfinite, numbers)):
        raise GraphError("a setpoint must be finite")
