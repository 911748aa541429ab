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
from volery.mavlink.autopilot.vehicle import Quaternion, Vector

LOCAL, BODY = (1, 7), (8, 12)
"""MAV_FRAME: LOCAL_NED and LOCAL_OFFSET_NED; BODY_NED and BODY_FRD. PX4 accepts 1, 8 and 12 only.
"""
_GLOBAL, _ABOVE_HOME = 5, (6, 11)
"""MAV_FRAME_GLOBAL_INT; GLOBAL_RELATIVE_ALT_INT and, over level ground, TERRAIN_ALT_INT."""
_FORCE, _NO_YAW, _NO_YAW_RATE = 512, 1024, 2048
_NOTHING = (math.nan, math.nan, math.nan)


class OffboardSetpoint(NamedTuple):
    """Setpoint of motion: ENU, FLU, rad; nan: unset."""

    position: Vector = _NOTHING
    """Position in the map, m."""
    velocity: Vector = _NOTHING
    acceleration: Vector = _NOTHING
    yaw: float = math.nan
    yaw_rate: float = math.nan
    in_heading: bool = False
    """Whether velocity and acceleration turn with the heading."""
    attitude: Quaternion | None = None
    rates: Vector | None = None
    thrust: float = math.nan


def local_setpoint(message: Any, origin: Vector) -> OffboardSetpoint:
    """Converts SET_POSITION_TARGET_LOCAL_NED. Raises `CommandError` if PX4 would refuse it."""
    if message.coordinate_frame not in (1, 8, 12):
        raise CommandError(f"setpoints in frame {message.coordinate_frame} are not supported")
    place = _masked((message.x, message.y, message.z), message.type_mask, 0)
    in_heading = message.coordinate_frame != 1
    if in_heading and not _empty(place):
        raise CommandError("positions in the body frame are not supported")
    east, north, up = enu_of_ned(place)
    position = (origin[0] + east, origin[1] + north, origin[2] + up)
    return _motion(message, position, in_heading)


def global_setpoint(message: Any, position: Vector) -> OffboardSetpoint:
    """Converts SET_POSITION_TARGET_GLOBAL_INT with the position `position`, m, map."""
    if message.coordinate_frame not in (0, 3, _GLOBAL, *_ABOVE_HOME):
        raise CommandError(f"setpoints in frame {message.coordinate_frame} are not supported")
    north, east, down = _masked((position[1], position[0], -position[2]), message.type_mask, 0)
    return _motion(message, (east, north, -down), in_heading=False)


def _motion(message: Any, position: Vector, in_heading: bool) -> OffboardSetpoint:
    mask = message.type_mask
    if mask & _FORCE:
        raise CommandError("setpoints of forces are not supported")
    velocity = _masked((message.vx, message.vy, message.vz), mask, 3)
    push = _masked((message.afx, message.afy, message.afz), mask, 6)
    turned = flu_of_frd if in_heading else enu_of_ned
    velocity, push = turned(velocity), turned(push)
    if _empty(position) and _empty(velocity) and _empty(push):
        raise CommandError("a setpoint needs at least one finite value")
    for vector in (position, velocity, push):
        if any(math.isinf(part) or abs(part) > 1e6 for part in vector):
            raise CommandError("a setpoint is out of range")
    yaw = math.nan if mask & _NO_YAW else 0.5 * math.pi - message.yaw
    rate = math.nan if mask & _NO_YAW_RATE else -message.yaw_rate
    if math.isinf(yaw) or math.isinf(rate):
        raise CommandError("a heading is out of range")
    if math.isfinite(yaw):
        yaw = math.remainder(yaw, 2.0 * math.pi)
    if in_heading and math.isfinite(yaw):
        yaw = math.nan  # in PX4 it is relative to the heading; only rates are useful there
    return OffboardSetpoint(position, velocity, push, yaw, rate, in_heading)


def attitude_setpoint(message: Any) -> OffboardSetpoint:
    """Converts SET_ATTITUDE_TARGET: an attitude, or body rates, with a thrust from 0 to 1."""
    mask, thrust = message.type_mask, message.thrust
    if mask & 64 or not 0.0 <= thrust <= 1.0:
        raise CommandError("an attitude needs a thrust from 0 to 1")
    if not mask & 128:
        w, x, y, z = message.q
        length = math.sqrt(w * w + x * x + y * y + z * z)
        if not (math.isfinite(length) and 0.9 <= length <= 1.1):
            raise CommandError("an attitude must be a unit quaternion")
        q = (x / length, y / length, z / length, w / length)
        return OffboardSetpoint(attitude=q_enu_flu_of_ned_frd(q), thrust=thrust)
    rates = (message.body_roll_rate, message.body_pitch_rate, message.body_yaw_rate)
    if mask & 7 or not all(math.isfinite(rate) and abs(rate) < 50.0 for rate in rates):
        raise CommandError("three finite body rates are needed")
    return OffboardSetpoint(rates=flu_of_frd(rates), thrust=thrust)


def _masked(vector: Vector, mask: int, first_bit: int) -> Vector:
    x, y, z = (
        math.nan if mask >> (first_bit + k) & 1 else float(part) for k, part in enumerate(vector)
    )
    return x, y, z


def _empty(vector: Vector) -> bool:
    return all(math.isnan(part) for part in vector)
