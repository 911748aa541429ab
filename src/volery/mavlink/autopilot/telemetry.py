"""Builders of the telemetry messages by id, NED and FRD.

Units are MAVLink's: degE7, mm, cm/s, mbar; unknown fields have the values that the dialect defines
for this.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from volery.core.frames import ned_of_enu
from volery.mavlink.autopilot import arming, dialect_extensions, motion, orbit, plans
from volery.mavlink.autopilot.modes import Mode
from volery.mavlink.autopilot.release import custom_version, flight_version
from volery.mavlink.codec import dialect

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot

_PX4 = 12
"""Value MAV_AUTOPILOT_PX4."""
_CHUNK = 50
"""Characters of a STATUSTEXT."""
_LONGEST_TEXT = 250
HOME_POSITION, MESSAGE_INTERVAL = 242, 244
_GYRO, _ACCEL, _MAG, _PRESSURE, _GPS = 1, 2, 4, 8, 32
_CONTROL = 1024 | 2048 | 4096 | 8192 | 16384 | 32768
_FENCE, _BATTERY, _PREARM = 1 << 20, 1 << 25, 1 << 28
"""MAV_SYS_STATUS_SENSOR: `_CONTROL` consists of rates, attitude, yaw, height, position, motors."""
_CAPABILITIES = 4 | 8 | 16 | 64 | 128 | 256 | 2048 | 8192 | 16384 | 32768
"""MAV_PROTOCOL_CAPABILITY: MISSION_INT, COMMAND_INT, PARAM_ENCODE_BYTEWISE, setpoints of attitude,
local and global positions, FLIGHT_TERMINATION, MAVLINK2, MISSION_FENCE, MISSION_RALLY."""
_ESTIMATES = 1 | 2 | 4 | 8 | 16 | 32 | 256 | 512
"""ESTIMATOR_STATUS_FLAGS: attitude, velocities, positions; without those relative to terrain."""


def HEARTBEAT(autopilot: Autopilot) -> Any:  # noqa: N802  (named as the message)
    """Returns HEARTBEAT: mode, armed, system status."""
    memory = autopilot.memory
    base = 1 | memory.mode.flags | (128 if memory.armed else 0)
    status = 4 if memory.armed else 3
    if memory.failsafe:
        status = 5
    if memory.state is not None and memory.state.crashed:
        status = 6
    kind = int(memory.parameters["MAV_TYPE"])
    return dialect().MAVLink_heartbeat_message(kind, _PX4, base, memory.mode.custom_mode, status, 3)


def _sys_status(autopilot: Autopilot) -> Any:
    state = autopilot.state
    has_battery = math.isfinite(state.charge)
    present = _GYRO | _ACCEL | _MAG | _PRESSURE | _GPS | _CONTROL | _FENCE | _PREARM
    present |= _BATTERY if has_battery else 0
    health = present
    if autopilot.memory.fix_lost:
        health &= ~_GPS
    if arming.problems(autopilot):
        health &= ~_PREARM
    if has_battery and state.charge < float(autopilot.parameter("BAT_CRIT_THR")):
        health &= ~_BATTERY
    if "fence" in autopilot.memory.warned:
        health &= ~_FENCE
    volts, amps, percent = 65535, -1, -1
    if has_battery:
        volts, amps = round(state.voltage * 1e3), motion.clipped(state.current * 1e2, 16)
        percent = round(state.charge * 1e2)
    return dialect().MAVLink_sys_status_message(
        present, present, health, 0, volts, amps, percent, 0, 0, 0, 0, 0, 0
    )


def _system_time(autopilot: Autopilot) -> Any:
    return dialect().MAVLink_system_time_message(0, motion.ms(autopilot))


def _extended_sys_state(autopilot: Autopilot) -> Any:
    landed = {"LANDED": 1, "CRASHED": 1, "TAKE_OFF": 3, "LAND": 4}.get(autopilot.state.mode, 2)
    return dialect().MAVLink_extended_sys_state_message(0, landed)


def _battery_status(autopilot: Autopilot) -> Any:
    state = autopilot.state
    if not math.isfinite(state.charge):
        return None
    cells = max(autopilot.build.battery_cells, 1)
    each = min(round(state.voltage / cells * 1e3), 65534)
    voltages = [each] * min(cells, 10) + [65535] * max(10 - cells, 0)
    more = [each] * min(max(cells - 10, 0), 4)
    used = round((1.0 - state.charge) * autopilot.build.battery_capacity_ah * 1e3)
    level = 1
    for name, number in (("LOW", 2), ("CRIT", 3), ("EMERGEN", 4)):
        if state.charge < float(autopilot.parameter(f"BAT_{name}_THR")):
            level = number
    return dialect().MAVLink_battery_status_message(
        0,
        1,
        1,
        32767,
        voltages,
        motion.clipped(state.current * 1e2, 16),
        used,
        -1,
        round(state.charge * 1e2),
        0,
        level,
        more + [0] * (4 - len(more)),
    )


def _home_position(autopilot: Autopilot) -> Any:
    home = autopilot.memory.home
    if home is None:
        return None
    origin = autopilot.memory.origin
    place = (home[0] - origin[0], home[1] - origin[1], home[2] - origin[2])
    return dialect().MAVLink_home_position_message(
        *motion.degrees_e7(autopilot.memory.chosen_home or autopilot.earth.geodetic(home)),
        *ned_of_enu(place),
        (math.nan,) * 4,
        *(math.nan,) * 3,
        motion.us(autopilot),
    )


def _global_origin(autopilot: Autopilot) -> Any:
    place = motion.degrees_e7(autopilot.earth.geodetic(autopilot.memory.origin))
    return dialect().MAVLink_gps_global_origin_message(*place, motion.us(autopilot))


def _estimator_status(autopilot: Autopilot) -> Any:
    flags = _ESTIMATES & ~(16 | 512) if autopilot.memory.fix_lost else _ESTIMATES
    ratios = (0.0,) * 4
    return dialect().MAVLink_estimator_status_message(
        motion.us(autopilot), flags, *ratios, math.nan, math.nan, math.nan, math.nan
    )


def _mission_current(autopilot: Autopilot) -> Any:
    mission, items = autopilot.memory.mission, autopilot.memory.plans[plans.MISSION]
    if not items:
        state = 1
    elif mission.complete:
        state = 5
    elif autopilot.memory.mode is Mode.MISSION and autopilot.memory.armed:
        state = 3
    else:
        state = 4 if mission.reached >= 0 else 2
    total = len(items) or 65535
    mode = 1 if autopilot.memory.mode is Mode.MISSION else 2
    return dialect().MAVLink_mission_current_message(mission.current, total, state, mode)


def _timesync(autopilot: Autopilot) -> Any:
    return dialect().MAVLink_timesync_message(0, autopilot.memory.now_ns)


def _autopilot_version(autopilot: Autopilot) -> Any:
    return dialect().MAVLink_autopilot_version_message(
        _CAPABILITIES,
        flight_version(),
        0,
        0,
        0,
        custom_version(),
        [0] * 8,
        [0] * 8,
        0,
        0,
        autopilot.system,
    )


def status_texts(severity: int, text: str) -> list[Any]:
    """Returns the STATUSTEXT messages of a text, in pieces if it is long."""
    raw = text[:_LONGEST_TEXT].encode("ascii", "replace")
    pieces = [raw[k : k + _CHUNK] for k in range(0, len(raw), _CHUNK)] or [b""]
    number = 0 if len(pieces) == 1 else 1 + sum(raw) % 65535
    status = dialect().MAVLink_statustext_message
    return [status(severity, piece, number, k) for k, piece in enumerate(pieces)]


BUILDERS: dict[int, Callable[[Autopilot], Any]] = {
    0: HEARTBEAT,
    1: _sys_status,
    2: _system_time,
    24: motion.gps_raw_int,
    29: motion.scaled_pressure,
    30: motion.attitude,
    31: motion.attitude_quaternion,
    32: motion.local_position,
    33: motion.global_position,
    36: motion.servo_output,
    42: _mission_current,
    49: _global_origin,
    74: motion.vfr_hud,
    83: motion.attitude_target,
    85: motion.position_target,
    105: motion.highres_imu,
    111: _timesync,
    141: motion.altitude,
    147: _battery_status,
    148: _autopilot_version,
    230: _estimator_status,
    HOME_POSITION: _home_position,
    245: _extended_sys_state,
    300: dialect_extensions.protocol_version,
    331: motion.odometry,
    360: orbit.status,
    436: dialect_extensions.current_mode,
}
"""Builders by message id; a builder returns None without data."""
