"""Executes the raw setpoints of MAVROS, whose mask selects the fields that count.

`PositionTarget` and `AttitudeTarget` are ROS messages in ROS frames: positions, velocities and
accelerations in the map frame (ENU), or, with the frame BODY_NED, in the level heading frame (FLU);
attitudes from FLU to map; thrust is a fraction of the max thrust of all rotors.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.core import rotations
from volery.core.errors import CommandError
from volery.runtime.vehicles.uav import Uav

IGNORE_POSITION = 1 | 2 | 4
IGNORE_VELOCITY = 8 | 16 | 32
IGNORE_ACCELERATION = 64 | 128 | 256
FORCE = 512
IGNORE_YAW = 1024
IGNORE_YAW_RATE = 2048
"""Bits of a PositionTarget's mask, as MAVLink's POSITION_TARGET_TYPEMASK."""
MAP_FRAME, HEADING_FRAME = 1, 8
"""MAV_FRAME_LOCAL_NED and MAV_FRAME_BODY_NED; MAVROS uses the names, but with ROS axes."""
IGNORE_RATES = 1 | 2 | 4
IGNORE_THRUST = 64
IGNORE_ATTITUDE = 128
"""Bits of an AttitudeTarget's mask, as MAVLink's ATTITUDE_TARGET_TYPEMASK."""


def steer_to_message(uav: Uav, message: Any) -> None:
    """Commands `uav` by a PositionTarget. Raises `CommandError`, also if a mask splits a vector.

    A position alone is a goal to hold; with a velocity it is a trajectory setpoint. The UAV holds
    velocities and accelerations until the next command, velocities at most until the timeout.
    """
    mask = int(message.type_mask)
    if mask & FORCE:
        raise CommandError("force setpoints are not supported; clear the FORCE bit of type_mask")
    position = _vector(message.position, mask, IGNORE_POSITION, "position")
    velocity = _vector(message.velocity, mask, IGNORE_VELOCITY, "velocity")
    push = _vector(message.acceleration_or_force, mask, IGNORE_ACCELERATION, "acceleration")
    yaw = None if mask & IGNORE_YAW else float(message.yaw)
    rate = 0.0 if mask & IGNORE_YAW_RATE else float(message.yaw_rate)
    if message.coordinate_frame == HEADING_FRAME:
        if position is not None:
            raise CommandError("positions are in the map frame; use coordinate_frame 1")
        turn = rotations.from_yaw(rotations.yaw_of(uav.attitude))
        velocity = None if velocity is None else rotations.rotate(turn, velocity)
        push = None if push is None else rotations.rotate(turn, push)
    elif message.coordinate_frame != MAP_FRAME:
        raise CommandError(f"no setpoints in frame {message.coordinate_frame}; 1 and 8 are known")
    nothing = np.zeros(3)
    if position is not None and velocity is None and push is None:
        uav.go_to(position, yaw)
    elif position is not None:
        motion = (nothing if velocity is None else velocity, nothing if push is None else push)
        uav.command_setpoint(position, *motion, yaw, rate)
    elif velocity is not None:
        uav.command_velocity_map(velocity, rate, yaw=yaw)
    elif push is not None:
        uav.command_acceleration(push, yaw, rate)
    else:
        raise CommandError("a setpoint needs a position, a velocity or an acceleration")


def turn_to_message(uav: Uav, message: Any) -> None:
    """Commands `uav` by an AttitudeTarget. Raises `CommandError`."""
    mask, thrust = int(message.type_mask), float(message.thrust)
    if mask & IGNORE_THRUST:
        raise CommandError("an attitude needs a thrust")
    if not 0.0 <= thrust <= 1.0:
        raise CommandError(f"thrust = {thrust} is out of range; from 0 to 1 is allowed")
    airframe = uav.airframe
    newtons = thrust * len(airframe.rotors.places) * airframe.max_rotor_thrust
    if not mask & IGNORE_ATTITUDE:
        q = message.orientation
        uav.command_attitude([q.x, q.y, q.z, q.w], newtons)
        return
    if mask & IGNORE_RATES:
        raise CommandError("without an attitude all three body rates are needed")
    rates = message.body_rate
    uav.command_rates([rates.x, rates.y, rates.z], newtons)


def turn_rotors(uav: Uav, message: Any) -> None:
    """Sets the rotor speeds of `uav` from a Float32MultiArray of fractions of full speed.

    Surplus numbers are ignored. Raises `CommandError` if there are fewer numbers than rotors.
    """
    rotors = uav.airframe.rotors
    shares = np.asarray(message.data, dtype=np.float64)
    if shares.size < len(rotors.places):
        raise CommandError(f"{uav.name} has {len(rotors.places)} rotors, not {shares.size}")
    uav.command_rotor_speeds(shares[: len(rotors.places)] * rotors.max_speed_rad_s)


def _vector(value: Any, mask: int, bits: int, what: str) -> Any:
    """Returns the vector (3,), or None if the mask ignores all of it."""
    ignored = mask & bits
    if ignored == bits:
        return None
    if ignored:
        raise CommandError(
            f"the mask ignores a part of the {what}; set all of its ignore bits or none"
        )
    return np.array([value.x, value.y, value.z])
