"""Parameters of the autopilot: all have an effect, with PX4's names and, if any, PX4's defaults.

`DEFAULTS` is the documented set; docs/mavlink.md lists it. Values are ints (INT32) or floats
(REAL32), sent as in PX4: the bytes of an int in the place of a float's.
"""

from __future__ import annotations

import math
import struct
import zlib
from typing import NamedTuple

Value = int | float
UINT32, INT32, REAL32 = 5, 6, 9
"""Values of MAV_PARAM_TYPE."""


class AutopilotParameter(NamedTuple):
    """One parameter: default, allowed range, description. `fixed` ones cannot be set."""

    default: Value
    low: float
    high: float
    description: str
    fixed: bool = False


DEFAULTS: dict[str, AutopilotParameter] = {
    "BAT_CRIT_THR": AutopilotParameter(
        0.07, 0.05, 0.5, "Charge fraction below which the battery is critical"
    ),
    "BAT_EMERGEN_THR": AutopilotParameter(
        0.05, 0.03, 0.5, "Charge fraction below which the battery is an emergency"
    ),
    "BAT_LOW_THR": AutopilotParameter(
        0.15, 0.12, 0.5, "Charge fraction below which the battery is low"
    ),
    "COM_ARM_WO_GPS": AutopilotParameter(0, 0, 1, "1: allow arming without a GNSS fix"),
    "COM_DISARM_LAND": AutopilotParameter(
        2.0, -1, 20, "Delay from landing to disarming, s; <= 0: never"
    ),
    "COM_DISARM_PRFLT": AutopilotParameter(
        10.0, -1, 60, "Delay from arming without take-off to disarming, s"
    ),
    "COM_DL_LOSS_T": AutopilotParameter(
        10, 5, 300, "Timeout of a ground station's heartbeat, s; then the data link is lost"
    ),
    "COM_LOW_BAT_ACT": AutopilotParameter(
        0,
        0,
        3,
        "Low battery: 0 warn; 2 land when critical; 3 return when critical, land in an emergency",
    ),
    "COM_OBL_RC_ACT": AutopilotParameter(
        0, 0, 5, "Offboard lost: 0-2 manual control, else hold; 3 return; 4 land; 5 hold"
    ),
    "COM_OF_LOSS_T": AutopilotParameter(1.0, 0.0, 60.0, "Timeout of offboard setpoints, s"),
    "COM_RC_LOSS_T": AutopilotParameter(
        0.5, 0.0, 35.0, "Timeout of MANUAL_CONTROL, s; then manual control is lost"
    ),
    "COM_TAKEOFF_ACT": AutopilotParameter(0, 0, 1, "After take-off: 0 hold, 1 mission"),
    "FLW_TGT_ALT_M": AutopilotParameter(0, 0, 2, "Follow: height above 0 and 1 home, 2 the target"),
    "FLW_TGT_DST": AutopilotParameter(
        8.0, 1.0, 1000.0, "Follow: horizontal distance to the target, m"
    ),
    "FLW_TGT_FA": AutopilotParameter(
        180.0, -180.0, 180.0, "Follow: angle clockwise from the target's course, deg"
    ),
    "FLW_TGT_HT": AutopilotParameter(8.0, 8.0, 150.0, "Follow: height, m"),
    "FLW_TGT_MAX_VEL": AutopilotParameter(
        5.0, 0.0, 20.0, "Follow: max speed towards the position relative to the target, m/s"
    ),
    "FLW_TGT_RS": AutopilotParameter(
        0.1, 0.0, 1.0, "Follow: weight of the old estimate when a target position arrives, 0 to 1"
    ),
    "GF_ACTION": AutopilotParameter(
        2, 0, 5, "Geofence breached: 0 none, 1 warn, 2 hold, 3 return, 4 terminate, 5 land"
    ),
    "GF_MAX_HOR_DIST": AutopilotParameter(
        0.0, 0.0, 10000.0, "Geofence: max horizontal distance from home, m; 0: no limit"
    ),
    "GF_MAX_VER_DIST": AutopilotParameter(
        0.0, 0.0, 10000.0, "Geofence: max height above home, m; 0: no limit"
    ),
    "MAV_SYS_ID": AutopilotParameter(1, 1, 250, "System id", fixed=True),
    "MAV_TYPE": AutopilotParameter(
        2, 0, 22, "Vehicle type: 2 quadrotor, 13 hexarotor, 14 octorotor", fixed=True
    ),
    "MIS_DIST_1WP": AutopilotParameter(
        10000.0,
        -1.0,
        100000.0,
        "Distance of the first waypoint from home that causes a warning, m; <= 0: no warning",
    ),
    "MIS_TAKEOFF_ALT": AutopilotParameter(2.5, 0.0, 80.0, "Default take-off height, m"),
    "MPC_ACC_HOR": AutopilotParameter(
        3.0, 0.5, 15.0, "Horizontal acceleration in automatic modes, m/s^2"
    ),
    "MPC_LAND_ALT1": AutopilotParameter(
        10.0, 0.0, 122.0, "Height above home below which a landing slows down, m"
    ),
    "MPC_LAND_ALT2": AutopilotParameter(
        5.0, 0.0, 122.0, "Height above home below which a landing descends at MPC_LAND_SPEED, m"
    ),
    "MPC_LAND_SPEED": AutopilotParameter(
        0.7, 0.6, 4.0, "Descent speed of a landing near the ground, m/s"
    ),
    "MPC_MAN_TILT_MAX": AutopilotParameter(
        35.0, 1.0, 70.0, "Tilt at full stick in altitude mode, deg"
    ),
    "MPC_MAN_Y_MAX": AutopilotParameter(150.0, 0.0, 400.0, "Yaw rate at full stick, deg/s"),
    "MPC_THR_HOVER": AutopilotParameter(
        0.5, 0.1, 0.8, "Hover thrust as a fraction of full thrust", fixed=True
    ),
    "MPC_VEL_MANUAL": AutopilotParameter(
        10.0, 3.0, 20.0, "Speed at full stick in position mode, m/s"
    ),
    "MPC_XY_CRUISE": AutopilotParameter(
        5.0, 3.0, 20.0, "Horizontal cruise speed in automatic modes, m/s"
    ),
    "MPC_XY_VEL_MAX": AutopilotParameter(
        12.0, 0.0, 20.0, "Max horizontal speed of any setpoint, m/s"
    ),
    "MPC_Z_VEL_MAX_DN": AutopilotParameter(1.5, 0.5, 4.0, "Max descent speed, m/s"),
    "MPC_Z_VEL_MAX_UP": AutopilotParameter(3.0, 0.5, 8.0, "Max climb speed, m/s"),
    "MPC_Z_V_AUTO_DN": AutopilotParameter(1.5, 0.5, 4.0, "Descent speed in automatic modes, m/s"),
    "MPC_Z_V_AUTO_UP": AutopilotParameter(3.0, 0.5, 8.0, "Climb speed in automatic modes, m/s"),
    "NAV_ACC_RAD": AutopilotParameter(2.0, 0.05, 200.0, "Acceptance radius of waypoints, m"),
    "NAV_DLL_ACT": AutopilotParameter(0, 0, 3, "Data link lost: 0 none, 1 hold, 2 return, 3 land"),
    "NAV_MC_ALT_RAD": AutopilotParameter(
        0.8, 0.05, 200.0, "Vertical acceptance radius of waypoints, m"
    ),
    "NAV_RCL_ACT": AutopilotParameter(2, 1, 3, "Manual control lost: 1 hold, 2 return, 3 land"),
    "RTL_DESCEND_ALT": AutopilotParameter(
        30.0, 0.0, 100.0, "Return: height above home after the descent at home, m"
    ),
    "RTL_LAND_DELAY": AutopilotParameter(
        0.0, -1.0, 300.0, "Return: delay before the landing, s; -1: never land"
    ),
    "RTL_MIN_DIST": AutopilotParameter(
        10.0, 0.5, 100.0, "Return: distance from home below which the UAV does not climb, m"
    ),
    "RTL_RETURN_ALT": AutopilotParameter(60.0, 0.0, 150.0, "Return: height above home, m"),
    "SDLOG_MODE": AutopilotParameter(
        0, -1, 2, "Flight log: -1 none, 0 armed, 1 from start to first disarming, 2 always"
    ),
    "SYS_AUTOSTART": AutopilotParameter(
        4001, 0, 9999999, "PX4's number of a generic quadrotor", fixed=True
    ),
    "SYS_FAILURE_EN": AutopilotParameter(0, 0, 1, "1: allow the injection of failures"),
}
NAMES = tuple(sorted(DEFAULTS))
CHECK = "_HASH_CHECK"
"""Name under which the check of all values is sent."""


def defaults() -> dict[str, Value]:
    """Returns all default values."""
    return {name: DEFAULTS[name].default for name in NAMES}


def type_of(name: str) -> int:
    """Returns the MAV_PARAM_TYPE of a parameter."""
    return INT32 if isinstance(DEFAULTS[name].default, int) else REAL32


def refusal(name: str, value: Value) -> str:
    """Returns why a parameter cannot be set to a value; empty if it can."""
    parameter = DEFAULTS.get(name)
    if parameter is None:
        return f"no parameter {name}"
    if parameter.fixed:
        return f"{name} cannot be set"
    if not (math.isfinite(value) and parameter.low <= value <= parameter.high):
        return f"{name}: {parameter.low:g} to {parameter.high:g}"
    return ""


def on_wire(name: str, value: Value) -> float:
    """Returns the float that carries a value."""
    if type_of(name) == INT32:
        packed: float = struct.unpack("<f", struct.pack("<i", int(value)))[0]
        return packed
    return float(value)


def check_of(values: dict[str, Value]) -> int:
    """Returns the CRC-32 over names and values, with which stations check theirs.

    As in PX4's `param_hash_check`, the remainder begins with 0 and is not inverted.
    """
    packed = (struct.pack("<i" if type_of(name) == INT32 else "<f", values[name]) for name in NAMES)
    data = b"".join(
        part for pair in zip(map(str.encode, NAMES), packed, strict=True) for part in pair
    )
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def from_wire(kind: int, carried: float) -> Value | None:
    """Returns the value in a float of MAV_PARAM_TYPE `kind`; None for other types than PX4's."""
    if kind == INT32:
        value: int = struct.unpack("<i", struct.pack("<f", carried))[0]
        return value
    return float(carried) if kind == REAL32 else None
