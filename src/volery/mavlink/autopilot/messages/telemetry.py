"""Builders of the telemetry messages by id, NED and FRD.

Units are MAVLink's: degE7, mm, cm/s, mbar; unknown fields have the values that the dialect defines
for this.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.messages import dialect_extensions, motion
from volery.mavlink.autopilot.messages.release import custom_version, flight_version
from volery.mavlink.autopilot.messages.status_messages import heartbeat
from volery.mavlink.autopilot.modes import orbit
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.protocols import plans
from volery.mavlink.autopilot.safety import arming, home
from volery.mavlink.codec import dialect

MESSAGE_INTERVAL = 244
_GYRO, _ACCEL, _MAG, _PRESSURE, _GPS = 1, 2, 4, 8, 32
_CONTROL = 1024 | 2048 | 4096 | 8192 | 16384 | 32768
_FENCE, _BATTERY, _PREARM = 1 << 20, 1 << 25, 1 << 28
"""MAV_SYS_STATUS_SENSOR: `_CONTROL` consists of rates, attitude, yaw, height, position, motors."""
_CAPABILITIES = 4 | 8 | 16 | 64 | 128 | 256 | 2048 | 8192 | 16384 | 32768
"""MAV_PROTOCOL_CAPABILITY: MISSION_INT, COMMAND_INT, PARAM_ENCODE_BYTEWISE, setpoints of attitude,
local and global positions, FLIGHT_TERMINATION, MAVLINK2, MISSION_FENCE, MISSION_RALLY."""
_ESTIMATES = 1 | 2 | 4 | 8 | 16 | 32 | 256 | 512
"""ESTIMATOR_STATUS_FLAGS: attitude, velocities, positions; without those relative to terrain."""


def _sys_status(context: AutopilotContext) -> Any:
    state = context.state
    has_battery = math.isfinite(state.charge)
    present = _GYRO | _ACCEL | _MAG | _PRESSURE | _GPS | _CONTROL | _FENCE | _PREARM
    present |= _BATTERY if has_battery else 0
    health = present
    if context.memory.fix_lost:
        health &= ~_GPS
    if arming.problems(context):
        health &= ~_PREARM
    if has_battery and state.charge < float(context.parameter("BAT_CRIT_THR")):
        health &= ~_BATTERY
    if "fence" in context.memory.warned:
        health &= ~_FENCE
    volts, amps, percent = 65535, -1, -1
    if has_battery:
        volts, amps = round(state.voltage * 1e3), motion.clipped(state.current * 1e2, 16)
        percent = round(state.charge * 1e2)
    return dialect().MAVLink_sys_status_message(
        present, present, health, 0, volts, amps, percent, 0, 0, 0, 0, 0, 0
    )


def _system_time(context: AutopilotContext) -> Any:
    return dialect().MAVLink_system_time_message(0, motion.ms(context))


def _extended_sys_state(context: AutopilotContext) -> Any:
    landed = {"LANDED": 1, "CRASHED": 1, "TAKE_OFF": 3, "LAND": 4}.get(context.state.mode, 2)
    return dialect().MAVLink_extended_sys_state_message(0, landed)


def _battery_status(context: AutopilotContext) -> Any:
    state = context.state
    if not math.isfinite(state.charge):
        return None
    cells = max(context.build.battery_cells, 1)
    each = min(round(state.voltage / cells * 1e3), 65534)
    voltages = [each] * min(cells, 10) + [65535] * max(10 - cells, 0)
    more = [each] * min(max(cells - 10, 0), 4)
    used = round((1.0 - state.charge) * context.build.battery_capacity_ah * 1e3)
    level = 1
    for name, number in (("LOW", 2), ("CRIT", 3), ("EMERGEN", 4)):
        if state.charge < float(context.parameter(f"BAT_{name}_THR")):
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


def _global_origin(context: AutopilotContext) -> Any:
    position = motion.degrees_e7(context.earth.geodetic(context.memory.origin))
    return dialect().MAVLink_gps_global_origin_message(*position, motion.us(context))


def _estimator_status(context: AutopilotContext) -> Any:
    flags = _ESTIMATES & ~(16 | 512) if context.memory.fix_lost else _ESTIMATES
    ratios = (0.0,) * 4
    return dialect().MAVLink_estimator_status_message(
        motion.us(context), flags, *ratios, math.nan, math.nan, math.nan, math.nan
    )


def mission_current(context: AutopilotContext) -> Any:
    """Returns MISSION_CURRENT."""
    mission, items = context.memory.mission, context.memory.plans[plans.MISSION]
    if not items:
        state = 1
    elif mission.complete:
        state = 5
    elif context.memory.mode is Mode.MISSION and context.memory.armed:
        state = 3
    else:
        state = 4 if mission.reached >= 0 else 2
    total = len(items) or 65535
    mode = 1 if context.memory.mode is Mode.MISSION else 2
    return dialect().MAVLink_mission_current_message(mission.current, total, state, mode)


def _timesync(context: AutopilotContext) -> Any:
    return dialect().MAVLink_timesync_message(0, context.memory.now_ns)


def _autopilot_version(context: AutopilotContext) -> Any:
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
        context.system,
    )


BUILDERS: dict[int, Callable[[AutopilotContext], Any]] = {
    0: lambda context: heartbeat(context.memory),
    1: _sys_status,
    2: _system_time,
    24: motion.gps_raw_int,
    29: motion.scaled_pressure,
    30: motion.attitude,
    31: motion.attitude_quaternion,
    32: motion.local_position,
    33: motion.global_position,
    36: motion.servo_output,
    42: mission_current,
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
    242: home.position_message,
    245: _extended_sys_state,
    300: dialect_extensions.protocol_version,
    331: motion.odometry,
    360: orbit.status,
    436: dialect_extensions.current_mode,
}
"""Builders by message id; a builder returns None without data."""
