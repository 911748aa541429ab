"""Converts offboard setpoints from MAVLink's messages to commands for the UAV, by PX4's rules.

PX4 gives each axis a position, a velocity and an acceleration, nan if a mask ignores it. A setpoint
is valid if at least one of the three vectors has a finite component; mixtures (velocity along the
ground, a height) are allowed, as in PX4.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from volery.core.errors import CommandError
from volery.core.frames import enu_of_ned, flu_of_frd, q_enu_flu_of_ned_frd
from volery.core.rotations import rotate, yaw_of
from volery.mavlink.autopilot.vehicle import Quaternion, Vector

_LOCAL_NED, BODY = 1, (8, 12)
"""MAV_FRAME: LOCAL_NED; BODY_NED and BODY_FRD."""
GLOBAL = (0, 3, 5, 6)
"""MAV_FRAME: GLOBAL and GLOBAL_RELATIVE_ALT, and both with INT. There are no terrain data."""
_NO_POSITION, _FORCE, _NO_YAW, _NO_YAW_RATE = 7, 512, 1024, 2048
"""Bits of POSITION_TARGET_TYPEMASK."""
_NO_TILT, _NO_TURN, _BODY_THRUST, _NO_THRUST, _NO_ATTITUDE = 3, 4, 32, 64, 128
"""Bits of ATTITUDE_TARGET_TYPEMASK."""
_NOTHING = (math.nan, math.nan, math.nan)


class OffboardSetpoint(NamedTuple):
    """Setpoint of motion: ENU, FLU, rad; nan: unset."""

    position: Vector = _NOTHING
    """Position in the map, m."""
    velocity: Vector = _NOTHING
    acceleration: Vector = _NOTHING
    yaw: float = math.nan
    yaw_rate: float = math.nan
    attitude: Quaternion | None = None
    rates: Vector | None = None
    thrust: float = math.nan


def local_setpoint(message: Any, origin: Vector, attitude: Quaternion) -> OffboardSetpoint:
    """Converts SET_POSITION_TARGET_LOCAL_NED for a UAV with `attitude`.

    In body frames a position is ignored, and a vector counts if it has all its components, as in
    PX4. Raises `CommandError` if PX4 would refuse the message.
    """
    frame, mask = message.coordinate_frame, message.type_mask
    if frame not in (_LOCAL_NED, *BODY):
        raise CommandError(f"coordinate frame {frame} unsupported")
    velocity = _masked((message.vx, message.vy, message.vz), mask, 3)
    push = _masked((message.afx, message.afy, message.afz), mask, 6)
    if frame in BODY:
        velocity = from_heading(flu_of_frd(velocity), attitude)
        push = from_body(flu_of_frd(push), attitude)
        return _motion(message, _NOTHING, velocity, push)
    east, north, up = enu_of_ned(_masked((message.x, message.y, message.z), mask, 0))
    position = (origin[0] + east, origin[1] + north, origin[2] + up)
    return _motion(message, position, enu_of_ned(velocity), enu_of_ned(push))


def global_setpoint(message: Any, position: Vector) -> OffboardSetpoint:
    """Converts SET_POSITION_TARGET_GLOBAL_INT with the position `position`, m, map.

    A position without one of its components is ignored, as in PX4.
    """
    mask = message.type_mask
    placed = not mask & _NO_POSITION
    if placed and message.coordinate_frame not in GLOBAL:
        raise CommandError(f"invalid coordinate frame {message.coordinate_frame}")
    if placed and not (abs(message.lat_int) <= 90e7 and abs(message.lon_int) <= 180e7):
        raise CommandError("position is not on the earth")
    velocity = _masked((message.vx, message.vy, message.vz), mask, 3)
    push = _masked((message.afx, message.afy, message.afz), mask, 6)
    target = position if placed else _NOTHING
    return _motion(message, target, enu_of_ned(velocity), enu_of_ned(push))


def _motion(message: Any, position: Vector, velocity: Vector, push: Vector) -> OffboardSetpoint:
    mask = message.type_mask
    if mask & _FORCE and not _empty(push):
        raise CommandError("force not supported")
    if _empty(position) and _empty(velocity) and _empty(push):
        raise CommandError("invalid: no position, velocity or acceleration")
    for vector in (position, velocity, push):
        if any(abs(part) > 1e6 for part in vector):
            raise CommandError("out of range")
    yaw = math.nan if mask & _NO_YAW else 0.5 * math.pi - message.yaw
    rate = math.nan if mask & _NO_YAW_RATE else -message.yaw_rate
    if math.isinf(yaw) or math.isinf(rate):
        raise CommandError("yaw is out of range")
    if math.isfinite(yaw):
        yaw = math.remainder(yaw, 2.0 * math.pi)
    return OffboardSetpoint(position, velocity, push, yaw, rate)


def attitude_setpoint(message: Any, rates_now: Vector) -> OffboardSetpoint:
    """Converts SET_ATTITUDE_TARGET: an attitude, else body rates, with a thrust from 0 to 1.

    An ignored yaw rate is the present one of `rates_now`, rad/s, body, as in PX4.
    """
    mask, thrust = message.type_mask, message.thrust
    if mask & _BODY_THRUST:
        raise CommandError("thrust_body not supported")
    if mask & _NO_THRUST or not 0.0 <= thrust <= 1.0:
        raise CommandError("a thrust from 0 to 1 is needed")
    rates = flu_of_frd((message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate))
    if not mask & _NO_ATTITUDE:
        if not mask & _NO_TURN and math.isfinite(rates[2]) and rates[2] != 0.0:
            raise CommandError("a yaw rate with an attitude is not supported")
        w, x, y, z = message.q
        length = math.sqrt(w * w + x * x + y * y + z * z)
        if not (math.isfinite(length) and 0.9 <= length <= 1.1):
            raise CommandError("q must be a unit quaternion")
        q = (x / length, y / length, z / length, w / length)
        return OffboardSetpoint(attitude=q_enu_flu_of_ned_frd(q), thrust=thrust)
    if mask & _NO_TILT:
        raise CommandError("an attitude, or roll and pitch rates are needed")
    if mask & _NO_TURN:
        rates = (rates[0], rates[1], rates_now[2])
    if not all(math.isfinite(rate) and abs(rate) < 50.0 for rate in rates):
        raise CommandError("body rates are out of range")
    return OffboardSetpoint(rates=rates, thrust=thrust)


def from_heading(vector: Vector, attitude: Quaternion) -> Vector:
    """Rotates a vector from the UAV's level frame to the map; with a nan component to nan."""
    x, y, z = vector
    if not all(map(math.isfinite, vector)):
        return _NOTHING
    yaw = float(yaw_of(list(attitude)))
    c, s = math.cos(yaw), math.sin(yaw)
    return c * x - s * y, s * x + c * y, z


def from_body(vector: Vector, attitude: Quaternion) -> Vector:
    """Rotates a vector from the UAV's body to the map; with a nan component to nan."""
    if not all(map(math.isfinite, vector)):
        return _NOTHING
    x, y, z = rotate(attitude, vector).tolist()
    return x, y, z


def _masked(vector: Vector, mask: int, first_bit: int) -> Vector:
    x, y, z = (
        math.nan if mask >> (first_bit + k) & 1 else float(part) for k, part in enumerate(vector)
    )
    return x, y, z


def _empty(vector: Vector) -> bool:
    return all(math.isnan(part) for part in vector)
