"""What is told of the vehicle: a builder for each message, NED and FRD, by its id.

Units are MAVLink's: degE7, mm, cm/s, mbar; unknown fields hold the values that the dialect gives
for that.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from volery.core.atmosphere import pressure
from volery.core.frames import frd_of_flu, ned_of_enu, q_ned_frd_of_enu_flu
from volery.mavlink import arming, plans
from volery.mavlink.codec import dialect
from volery.mavlink.modes import Mode

if TYPE_CHECKING:
    from volery.mavlink.autopilot import Autopilot
    from volery.mavlink.vehicle import FlightState, Quaternion, Vector

_PX4 = 12
"""MAV_AUTOPILOT_PX4."""
_CHUNK = 50
"""Characters of a STATUSTEXT."""
_LONGEST_TEXT = 250
_GRAVITY = 9.80665
HOME_POSITION, MESSAGE_INTERVAL = 242, 244
_GYRO, _ACCEL, _MAG, _PRESSURE, _GPS = 1, 2, 4, 8, 32
_CONTROL = 1024 | 2048 | 4096 | 8192 | 16384 | 32768
_FENCE, _BATTERY, _PREARM = 1 << 20, 1 << 25, 1 << 28
"""MAV_SYS_STATUS_SENSOR: rates, attitude, yaw, height, place, motors make up `_CONTROL`."""
_CAPABILITIES = 4 | 8 | 16 | 64 | 128 | 256 | 2048 | 8192 | 16384 | 32768
"""MAV_PROTOCOL_CAPABILITY: MISSION_INT, COMMAND_INT, PARAM_ENCODE_BYTEWISE, setpoints of attitude,
local and global places, FLIGHT_TERMINATION, MAVLINK2, MISSION_FENCE, MISSION_RALLY."""
_ESTIMATES = 1 | 2 | 4 | 8 | 16 | 32 | 256 | 512
"""ESTIMATOR_STATUS_FLAGS: attitude, velocities, places; without relative ones to terrain."""


def _ms(pilot: Autopilot) -> int:
    return pilot.memory.now_ns // 1_000_000 & 0xFFFFFFFF


def _us(pilot: Autopilot) -> int:
    return pilot.memory.now_ns // 1_000


def _local(pilot: Autopilot) -> tuple[Vector, Vector]:
    """Place from the local origin and velocity, NED."""
    state, origin = pilot.state, pilot.memory.origin
    x, y, z = (here - there for here, there in zip(state.position, origin, strict=True))
    return ned_of_enu((x, y, z)), ned_of_enu(state.velocity)


def _roll_pitch_yaw(q: Quaternion) -> Vector:
    x, y, z, w = q
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


def _degrees_e7(geodetic: Vector) -> tuple[int, int, int]:
    latitude, longitude, altitude = geodetic
    return round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3)


def _clipped(value: float, bits: int) -> int:
    """A whole number that fits a signed field."""
    limit = (1 << bits - 1) - 1
    return max(-limit, min(limit, round(value)))


def _heading_cdeg(pilot: Autopilot) -> int:
    degrees = 90.0 - math.degrees(pilot.yaw)
    return round(degrees % 360.0 * 100.0) % 36000


def HEARTBEAT(pilot: Autopilot) -> Any:  # noqa: N802  (named as the message)
    """Mode, whether it is armed, how it fares."""
    memory = pilot.memory
    base = 1 | memory.mode.flags | (128 if memory.armed else 0)
    status = 4 if memory.armed else 3
    if memory.failsafe:
        status = 5
    if memory.state is not None and memory.state.crashed:
        status = 6
    kind = int(memory.parameters["MAV_TYPE"])
    return dialect().MAVLink_heartbeat_message(kind, _PX4, base, memory.mode.custom_mode, status, 3)


def _sys_status(pilot: Autopilot) -> Any:
    state = pilot.state
    has_battery = math.isfinite(state.charge)
    present = _GYRO | _ACCEL | _MAG | _PRESSURE | _GPS | _CONTROL | _FENCE | _PREARM
    present |= _BATTERY if has_battery else 0
    health = present
    if pilot.memory.fix_lost:
        health &= ~_GPS
    if arming.troubles(pilot):
        health &= ~_PREARM
    if has_battery and state.charge < float(pilot.parameter("BAT_CRIT_THR")):
        health &= ~_BATTERY
    if "fence" in pilot.memory.warned:
        health &= ~_FENCE
    volts, amps, percent = 65535, -1, -1
    if has_battery:
        volts, amps = round(state.voltage * 1e3), _clipped(state.current * 1e2, 16)
        percent = round(state.charge * 1e2)
    return dialect().MAVLink_sys_status_message(
        present, present, health, 0, volts, amps, percent, 0, 0, 0, 0, 0, 0
    )


def _system_time(pilot: Autopilot) -> Any:
    return dialect().MAVLink_system_time_message(0, _ms(pilot))


def _gps_raw_int(pilot: Autopilot) -> Any:
    """As the estimate has it; of a UAV that has lost its fix: none."""
    place = _degrees_e7(pilot.geodetic())
    north, east, _ = ned_of_enu(pilot.state.velocity)
    speed = math.hypot(north, east)
    course = round(math.degrees(math.atan2(east, north)) % 360.0 * 100.0) % 36000
    lost = pilot.memory.now_ns - pilot.memory.fix_ns > 1_000_000_000
    fix, satellites = (1, 0) if lost else (3, 10)
    return dialect().MAVLink_gps_raw_int_message(
        _us(pilot),
        fix,
        *place,
        65535 if lost else 80,
        65535 if lost else 120,
        min(round(speed * 100.0), 65534),
        course if speed > 0.3 else 65535,
        satellites,
        place[2],
    )


def _attitude(pilot: Autopilot) -> Any:
    angles = _roll_pitch_yaw(q_ned_frd_of_enu_flu(pilot.state.attitude))
    return dialect().MAVLink_attitude_message(_ms(pilot), *angles, *frd_of_flu(pilot.state.rates))


def _attitude_quaternion(pilot: Autopilot) -> Any:
    x, y, z, w = q_ned_frd_of_enu_flu(pilot.state.attitude)
    sign = -1.0 if w < 0.0 else 1.0
    turned = (sign * w, sign * x, sign * y, sign * z)
    rates = frd_of_flu(pilot.state.rates)
    return dialect().MAVLink_attitude_quaternion_message(_ms(pilot), *turned, *rates)


def _local_position(pilot: Autopilot) -> Any:
    place, velocity = _local(pilot)
    return dialect().MAVLink_local_position_ned_message(_ms(pilot), *place, *velocity)


def _global_position(pilot: Autopilot) -> Any:
    state = pilot.state
    home = pilot.memory.home or pilot.memory.origin
    velocity = (_clipped(part * 100.0, 16) for part in ned_of_enu(state.velocity))
    return dialect().MAVLink_global_position_int_message(
        _ms(pilot),
        *_degrees_e7(pilot.geodetic()),
        round((state.position[2] - home[2]) * 1e3),
        *velocity,
        _heading_cdeg(pilot),
    )


def _highres_imu(pilot: Autopilot) -> Any:
    """Specific force and rates as the controllers feel them, pressure of the standard air."""
    state = pilot.state
    altitude = state.position[2] + pilot.build.origin[2]
    force = _specific_force(state)
    mbar = float(pressure(altitude)) / 100.0
    return dialect().MAVLink_highres_imu_message(
        _us(pilot),
        *frd_of_flu(force),
        *frd_of_flu(state.rates),
        *(math.nan,) * 3,
        mbar,
        math.nan,
        altitude,
        math.nan,
        0x3F | 0xA00,
    )


def _specific_force(state: FlightState) -> Vector:
    """m/s^2, body: what an accelerometer without errors feels."""
    x, y, z, w = state.attitude
    ax, ay, az = state.acceleration
    az += _GRAVITY
    tx, ty, tz = 2.0 * (z * ay - y * az), 2.0 * (x * az - z * ax), 2.0 * (y * ax - x * ay)
    return (
        ax + w * tx + z * ty - y * tz,
        ay + w * ty + x * tz - z * tx,
        az + w * tz + y * tx - x * ty,
    )


def _vfr_hud(pilot: Autopilot) -> Any:
    state = pilot.state
    speed = math.hypot(*state.velocity[:2])
    throttle = round(100.0 * sum(state.rotors) / max(len(state.rotors), 1))
    altitude = state.position[2] + pilot.build.origin[2]
    return dialect().MAVLink_vfr_hud_message(
        speed, speed, _heading_cdeg(pilot) // 100, throttle, altitude, state.velocity[2]
    )


def _altitude(pilot: Autopilot) -> Any:
    z = pilot.state.position[2]
    home = pilot.memory.home or pilot.memory.origin
    amsl = z + pilot.build.origin[2]
    local = z - pilot.memory.origin[2]
    return dialect().MAVLink_altitude_message(
        _us(pilot), amsl, amsl, local, z - home[2], math.nan, math.nan
    )


def _extended_sys_state(pilot: Autopilot) -> Any:
    landed = {"LANDED": 1, "CRASHED": 1, "TAKE_OFF": 3, "LAND": 4}.get(pilot.state.mode, 2)
    return dialect().MAVLink_extended_sys_state_message(0, landed)


def _battery_status(pilot: Autopilot) -> Any:
    state = pilot.state
    if not math.isfinite(state.charge):
        return None
    cells = max(pilot.build.battery_cells, 1)
    each = min(round(state.voltage / cells * 1e3), 65534)
    voltages = [each] * min(cells, 10) + [65535] * max(10 - cells, 0)
    more = [each] * min(max(cells - 10, 0), 4)
    used = round((1.0 - state.charge) * pilot.build.battery_capacity_ah * 1e3)
    level = 1
    for name, number in (("LOW", 2), ("CRIT", 3), ("EMERGEN", 4)):
        if state.charge < float(pilot.parameter(f"BAT_{name}_THR")):
            level = number
    return dialect().MAVLink_battery_status_message(
        0,
        1,
        1,
        32767,
        voltages,
        _clipped(state.current * 1e2, 16),
        used,
        -1,
        round(state.charge * 1e2),
        0,
        level,
        more + [0] * (4 - len(more)),
    )


def _home_position(pilot: Autopilot) -> Any:
    home = pilot.memory.home
    if home is None:
        return None
    origin = pilot.memory.origin
    place = (home[0] - origin[0], home[1] - origin[1], home[2] - origin[2])
    return dialect().MAVLink_home_position_message(
        *_degrees_e7(pilot.earth.geodetic(home)),
        *ned_of_enu(place),
        (math.nan,) * 4,
        *(math.nan,) * 3,
        _us(pilot),
    )


def _global_origin(pilot: Autopilot) -> Any:
    place = _degrees_e7(pilot.earth.geodetic(pilot.memory.origin))
    return dialect().MAVLink_gps_global_origin_message(*place, _us(pilot))


def _estimator_status(pilot: Autopilot) -> Any:
    flags = _ESTIMATES & ~(16 | 512) if pilot.memory.fix_lost else _ESTIMATES
    ratios = (0.0,) * 4
    return dialect().MAVLink_estimator_status_message(
        _us(pilot), flags, *ratios, math.nan, math.nan, math.nan, math.nan
    )


def _mission_current(pilot: Autopilot) -> Any:
    mission, items = pilot.memory.mission, pilot.memory.plans[plans.MISSION]
    if not items:
        state = 1
    elif mission.complete:
        state = 5
    elif pilot.memory.mode is Mode.MISSION and pilot.memory.armed:
        state = 3
    else:
        state = 4 if mission.reached >= 0 else 2
    total = len(items) or 65535
    mode = 1 if pilot.memory.mode is Mode.MISSION else 2
    return dialect().MAVLink_mission_current_message(mission.current, total, state, mode)


def _position_target(pilot: Autopilot) -> Any:
    target = pilot.memory.target
    if target is None or target.attitude is not None or target.rates is not None:
        return None
    origin = pilot.memory.origin
    x, y, z = (part - start for part, start in zip(target.position, origin, strict=True))
    vectors = (ned_of_enu((x, y, z)), ned_of_enu(target.velocity), ned_of_enu(target.acceleration))
    parts = [part for vector in vectors for part in vector]
    parts += [0.5 * math.pi - target.yaw, -target.yaw_rate]
    bits = (1, 2, 4, 8, 16, 32, 64, 128, 256, 1024, 2048)
    mask = sum(bit for bit, part in zip(bits, parts, strict=True) if not math.isfinite(part))
    return dialect().MAVLink_position_target_local_ned_message(_ms(pilot), 1, mask, *parts)


def _attitude_target(pilot: Autopilot) -> Any:
    target = pilot.memory.target
    if target is None or (target.attitude is None and target.rates is None):
        return None
    x, y, z, w = q_ned_frd_of_enu_flu(target.attitude or (0.0, 0.0, 0.0, 1.0))
    mask = 7 if target.attitude is not None else 128
    rates = frd_of_flu(target.rates or (0.0, 0.0, 0.0))
    return dialect().MAVLink_attitude_target_message(
        _ms(pilot), mask, [w, x, y, z], *rates, target.thrust
    )


def _servo_output(pilot: Autopilot) -> Any:
    pulses = [round(1000.0 + 1000.0 * min(share, 1.0)) for share in pilot.state.rotors]
    pulses = (pulses + [0] * 16)[:16]
    return dialect().MAVLink_servo_output_raw_message(
        _us(pilot) & 0xFFFFFFFF, 0, *pulses[:8], *pulses[8:]
    )


def _timesync(pilot: Autopilot) -> Any:
    return dialect().MAVLink_timesync_message(0, pilot.memory.now_ns)


def _autopilot_version(pilot: Autopilot) -> Any:
    from volery.mavlink.release import flight_version

    return dialect().MAVLink_autopilot_version_message(
        _CAPABILITIES,
        flight_version(),
        0,
        0,
        0,
        [0] * 8,
        [0] * 8,
        [0] * 8,
        0,
        0,
        pilot.system,
    )


def status_texts(severity: int, text: str) -> list[Any]:
    """STATUSTEXT of a text, in pieces where it is long."""
    raw = text[:_LONGEST_TEXT].encode("ascii", "replace")
    pieces = [raw[k : k + _CHUNK] for k in range(0, len(raw), _CHUNK)] or [b""]
    number = 0 if len(pieces) == 1 else 1 + sum(raw) % 65535
    status = dialect().MAVLink_statustext_message
    return [status(severity, piece, number, k) for k, piece in enumerate(pieces)]


BUILDERS: dict[int, Callable[[Autopilot], Any]] = {
    0: HEARTBEAT,
    1: _sys_status,
    2: _system_time,
    24: _gps_raw_int,
    30: _attitude,
    31: _attitude_quaternion,
    32: _local_position,
    33: _global_position,
    36: _servo_output,
    42: _mission_current,
    49: _global_origin,
    74: _vfr_hud,
    83: _attitude_target,
    85: _position_target,
    105: _highres_imu,
    111: _timesync,
    141: _altitude,
    147: _battery_status,
    148: _autopilot_version,
    230: _estimator_status,
    HOME_POSITION: _home_position,
    245: _extended_sys_state,
}
"""By message id; a builder returns None where there is nothing to tell."""
