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
    """One parameter: default, allowed range, effect. `fixed` ones cannot be set."""

    default: Value
    low: float
    high: float
    what: str
    fixed: bool = False


DEFAULTS: dict[str, AutopilotParameter] = {
    "BAT_CRIT_THR": AutopilotParameter(
        0.07, 0.05, 0.5, "charge below which the battery is critical"
    ),
    "BAT_EMERGEN_THR": AutopilotParameter(0.05, 0.03, 0.5, "charge below which it is an emergency"),
    "BAT_LOW_THR": AutopilotParameter(0.15, 0.12, 0.5, "charge below which the battery is low"),
    "COM_ARM_WO_GPS": AutopilotParameter(0, 0, 1, "1: arms without a fix"),
    "COM_DISARM_LAND": AutopilotParameter(2.0, -1, 20, "s from landing to disarming; <= 0: never"),
    "COM_DISARM_PRFLT": AutopilotParameter(
        10.0, -1, 60, "s from arming without take-off to disarming"
    ),
    "COM_DL_LOSS_T": AutopilotParameter(
        10, 5, 300, "s without a ground station's heartbeat: link lost"
    ),
    "COM_LOW_BAT_ACT": AutopilotParameter(
        0, 0, 3, "0 warning, 2 land when critical, 3 return when critical, land in an emergency"
    ),
    "COM_OBL_RC_ACT": AutopilotParameter(
        0, 0, 5, "offboard lost: 0 1 2 sticks, else hold; 3 return, 4 land, 5 hold"
    ),
    "COM_OF_LOSS_T": AutopilotParameter(
        1.0, 0.0, 60.0, "s without a setpoint after which offboard is lost"
    ),
    "COM_RC_LOSS_T": AutopilotParameter(0.5, 0.0, 35.0, "s without MANUAL_CONTROL: sticks lost"),
    "COM_TAKEOFF_ACT": AutopilotParameter(0, 0, 1, "after take-off: 0 hold, 1 mission"),
    "FLW_TGT_ALT_M": AutopilotParameter(0, 0, 2, "follow: height above 0 1 home, 2 the target"),
    "FLW_TGT_DST": AutopilotParameter(8.0, 1.0, 1000.0, "m from the target along the ground"),
    "FLW_TGT_FA": AutopilotParameter(
        180.0, -180.0, 180.0, "deg clockwise from the target's course"
    ),
    "FLW_TGT_HT": AutopilotParameter(8.0, 8.0, 150.0, "m of height while it follows"),
    "FLW_TGT_MAX_VEL": AutopilotParameter(
        5.0, 0.0, 20.0, "m/s towards its position beside the target"
    ),
    "FLW_TGT_RS": AutopilotParameter(
        0.1, 0.0, 1.0, "share of the old estimate that a position leaves"
    ),
    "GF_ACTION": AutopilotParameter(
        2, 0, 5, "fence: 0 none, 1 warning, 2 hold, 3 return, 4 end, 5 land"
    ),
    "GF_MAX_HOR_DIST": AutopilotParameter(0.0, 0.0, 10000.0, "m from home; 0: any"),
    "GF_MAX_VER_DIST": AutopilotParameter(0.0, 0.0, 10000.0, "m above home; 0: any"),
    "MAV_SYS_ID": AutopilotParameter(1, 1, 250, "system id", fixed=True),
    "MAV_TYPE": AutopilotParameter(2, 0, 22, "2 quadrotor, 13 hexarotor, 14 octorotor", fixed=True),
    "MIS_DIST_1WP": AutopilotParameter(
        10000.0, -1.0, 100000.0, "m from home: farther first waypoints are told of; <= 0: none"
    ),
    "MIS_TAKEOFF_ALT": AutopilotParameter(
        2.5, 0.0, 80.0, "m: height of a take-off that names none"
    ),
    "MPC_ACC_HOR": AutopilotParameter(3.0, 0.5, 15.0, "m/s^2 of the way to places"),
    "MPC_LAND_ALT1": AutopilotParameter(
        10.0, 0.0, 122.0, "m above home: lower landings sink more slowly"
    ),
    "MPC_LAND_ALT2": AutopilotParameter(
        5.0, 0.0, 122.0, "m above home: lower ones with MPC_LAND_SPEED"
    ),
    "MPC_LAND_SPEED": AutopilotParameter(0.7, 0.6, 4.0, "m/s of a landing near the ground"),
    "MPC_MAN_TILT_MAX": AutopilotParameter(35.0, 1.0, 70.0, "deg at full stick, altitude mode"),
    "MPC_MAN_Y_MAX": AutopilotParameter(150.0, 0.0, 400.0, "deg/s of yaw at full stick"),
    "MPC_THR_HOVER": AutopilotParameter(
        0.5, 0.1, 0.8, "share of the full thrust that carries", fixed=True
    ),
    "MPC_VEL_MANUAL": AutopilotParameter(10.0, 3.0, 20.0, "m/s at full stick, position mode"),
    "MPC_XY_CRUISE": AutopilotParameter(5.0, 3.0, 20.0, "m/s of the way to places"),
    "MPC_XY_VEL_MAX": AutopilotParameter(12.0, 0.0, 20.0, "m/s: no setpoint is flown faster"),
    "MPC_Z_VEL_MAX_DN": AutopilotParameter(1.5, 0.5, 4.0, "m/s of descent, at most"),
    "MPC_Z_VEL_MAX_UP": AutopilotParameter(3.0, 0.5, 8.0, "m/s of climb, at most"),
    "MPC_Z_V_AUTO_DN": AutopilotParameter(
        1.5, 0.5, 4.0, "m/s of descent to places and of landings"
    ),
    "MPC_Z_V_AUTO_UP": AutopilotParameter(3.0, 0.5, 8.0, "m/s of climb to places"),
    "NAV_ACC_RAD": AutopilotParameter(2.0, 0.05, 200.0, "m from a waypoint that count as there"),
    "NAV_DLL_ACT": AutopilotParameter(0, 0, 3, "link lost: 0 nothing, 1 hold, 2 return, 3 land"),
    "NAV_MC_ALT_RAD": AutopilotParameter(0.8, 0.05, 200.0, "m above or below that count as there"),
    "NAV_RCL_ACT": AutopilotParameter(2, 1, 3, "sticks lost: 1 hold, 2 return, 3 land"),
    "RTL_DESCEND_ALT": AutopilotParameter(
        30.0, 0.0, 100.0, "m above home: returns come down to there"
    ),
    "RTL_LAND_DELAY": AutopilotParameter(
        0.0, -1.0, 300.0, "s that a return waits there; -1: for ever"
    ),
    "RTL_MIN_DIST": AutopilotParameter(
        10.0, 0.5, 100.0, "m from home: nearer returns do not climb"
    ),
    "RTL_RETURN_ALT": AutopilotParameter(60.0, 0.0, 150.0, "m above home: height of a return"),
    "SDLOG_MODE": AutopilotParameter(
        0, -1, 2, "flight log: -1 none, 0 armed, 1 from the start to the first disarming, 2 always"
    ),
    "SYS_AUTOSTART": AutopilotParameter(
        4001, 0, 9999999, "PX4's number of a generic quadrotor", fixed=True
    ),
    "SYS_FAILURE_EN": AutopilotParameter(0, 0, 1, "1: failures may be injected"),
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
