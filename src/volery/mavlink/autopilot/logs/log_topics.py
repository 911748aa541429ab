"""Topics of a flight log: PX4's topics with their names, units and usual rates.

Fields are the known ones of PX4 1.18 (NED, FRD, quaternions w x y z). Rates are those of its
default profile (`logged_topics.cpp`), limited by the rate of the vehicle's state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

from volery.core.data_tables import read_table
from volery.core.frames import frd_of_flu, ned_of_enu, q_ned_frd_of_enu_flu
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.geo_reference import GeoReference
from volery.mavlink.autopilot.logs.ulog import UlogTopic
from volery.mavlink.autopilot.messages import motion
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.vehicle import Vector

Values = Sequence[float]
_NAN = math.nan
_NAV_STATES = {
    Mode.ALTITUDE: 1,
    Mode.POSITION: 2,
    Mode.MISSION: 3,
    Mode.HOLD: 4,
    Mode.RETURN: 5,
    Mode.OFFBOARD: 14,
    Mode.TAKE_OFF: 17,
    Mode.LAND: 18,
    Mode.FOLLOW_TARGET: 19,
    Mode.ORBIT: 21,
}
_DISARMED, _ARMED, _ROTARY_WING = 1, 2, 1
_MOTORS = 12
"""Motors of `actuator_motors`."""
_WARNINGS = (("BAT_EMERGEN_THR", 3), ("BAT_CRIT_THR", 2), ("BAT_LOW_THR", 1))


class LoggedTopic(NamedTuple):
    """A topic, its sampling period, and the function that reads its values.

    values: returns None if there is nothing to log.
    """

    topic: UlogTopic
    period_ns: int
    values: Callable[[AutopilotContext], Values | None]


def _attitude(context: AutopilotContext) -> Values:
    x, y, z, w = q_ned_frd_of_enu_flu(context.state.attitude)
    time_us = motion.us(context)
    return time_us, time_us, w, x, y, z


def _angular_velocity(context: AutopilotContext) -> Values:
    time_us = motion.us(context)
    return time_us, time_us, *frd_of_flu(context.state.rates)


def _acceleration(context: AutopilotContext) -> Values:
    time_us = motion.us(context)
    return time_us, time_us, *frd_of_flu(motion.specific_force(context.state))


def _local_position(context: AutopilotContext) -> Values:
    time_us, memory = motion.us(context), context.memory
    position, velocity = motion.local_motion(context)
    heading = math.remainder(0.5 * math.pi - context.yaw, 2.0 * math.pi)
    has_fix = not memory.fix_lost
    return (
        *(time_us, time_us, has_fix, True, has_fix, True),
        *position,
        *velocity,
        velocity[2],
        *ned_of_enu(context.state.acceleration),
        *(heading, True, has_fix, True, 0),
        *_reference(context.earth, memory.origin),
    )


@lru_cache(maxsize=256)
def _reference(earth: GeoReference, origin: Vector) -> Vector:
    """Returns latitude, longitude, degrees, and altitude, m, of the local frame's origin."""
    return earth.geodetic(origin)


def _global_position(context: AutopilotContext) -> Values:
    time_us = motion.us(context)
    return time_us, time_us, *context.geodetic(), not context.memory.fix_lost, True


def _status(context: AutopilotContext) -> Values:
    memory, nav_state = context.memory, _NAV_STATES[context.memory.mode]
    return (
        motion.us(context),
        memory.armed_ns // 1000 if memory.armed else 0,
        _ARMED if memory.armed else _DISARMED,
        nav_state,
        nav_state,
        _ROTARY_WING,
        memory.failsafe,
        int(memory.parameters["MAV_TYPE"]),
        context.system,
        1,
    )


def _land_detected(context: AutopilotContext) -> Values:
    return motion.us(context), not context.state.airborne


def _battery(context: AutopilotContext) -> Values | None:
    state = context.state
    if not math.isfinite(state.charge):
        return None
    used_mah = (1.0 - state.charge) * context.build.battery_capacity_ah * 1e3
    warning = next(
        (level for name, level in _WARNINGS if state.charge < float(context.parameter(name))), 0
    )
    cells = context.build.battery_cells
    return (
        *(motion.us(context), 1, True, state.voltage, state.current, used_mah, state.charge),
        *(warning, cells),
    )


def _motors(context: AutopilotContext) -> Values:
    time_us = motion.us(context)
    speeds = context.state.rotors[:_MOTORS] if context.memory.armed else ()
    thrusts = [speed * speed for speed in speeds]
    return time_us, time_us, 0, *thrusts, *(_NAN,) * (_MOTORS - len(thrusts))


def _trajectory_setpoint(context: AutopilotContext) -> Values | None:
    parts = motion.target_motion(context)
    if parts is None:
        return None
    return motion.us(context), *parts[:9], *(_NAN,) * 3, *parts[9:]


def _attitude_setpoint(context: AutopilotContext) -> Values | None:
    target = context.memory.target
    if target is None or target.attitude is None:
        return None
    x, y, z, w = q_ned_frd_of_enu_flu(target.attitude)
    return motion.us(context), _NAN, w, x, y, z, 0.0, 0.0, -target.thrust


def _rates_setpoint(context: AutopilotContext) -> Values | None:
    target = context.memory.target
    if target is None or target.rates is None:
        return None
    return motion.us(context), *frd_of_flu(target.rates), 0.0, 0.0, -target.thrust


_VALUES: dict[str, Callable[[AutopilotContext], Values | None]] = {
    "vehicle_attitude": _attitude,
    "vehicle_angular_velocity": _angular_velocity,
    "vehicle_acceleration": _acceleration,
    "vehicle_local_position": _local_position,
    "vehicle_global_position": _global_position,
    "vehicle_status": _status,
    "vehicle_land_detected": _land_detected,
    "battery_status": _battery,
    "actuator_motors": _motors,
    "trajectory_setpoint": _trajectory_setpoint,
    "vehicle_attitude_setpoint": _attitude_setpoint,
    "vehicle_rates_setpoint": _rates_setpoint,
}
TOPICS = tuple(
    LoggedTopic(
        UlogTopic(number, name, ";".join(row["fields"])),
        row["period_ms"] * 1_000_000,
        _VALUES[name],
    )
    for number, (name, row) in enumerate(read_table(__file__, "log_topics.toml").items())
)
