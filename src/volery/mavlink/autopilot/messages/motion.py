"""Builds messages about a vehicle's motion: NED, FRD, MAVLink's units (degE7, mm, cm/s, mbar).

Unknown fields have the values that the dialect defines for this.
"""

from __future__ import annotations

import math
from typing import Any

from volery.core.atmosphere import pressure
from volery.core.frames import frd_of_flu, ned_of_enu, q_ned_frd_of_enu_flu
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.vehicle import FlightState, Quaternion, Vector
from volery.mavlink.codec import dialect

_GRAVITY = 9.80665
_LOCAL_NED, _BY_AUTOPILOT = 1, 8
"""Values of MAV_FRAME and MAV_ESTIMATOR_TYPE."""


def ms(context: AutopilotContext) -> int:
    """Returns milliseconds since the start."""
    return context.memory.now_ns // 1_000_000 & 0xFFFFFFFF


def us(context: AutopilotContext) -> int:
    """Returns microseconds since the start."""
    return context.memory.now_ns // 1_000


def local_motion(context: AutopilotContext) -> tuple[Vector, Vector]:
    """Returns position from the local origin and velocity, NED."""
    state, origin = context.state, context.memory.origin
    x, y, z = (here - there for here, there in zip(state.position, origin, strict=True))
    return ned_of_enu((x, y, z)), ned_of_enu(state.velocity)


def _roll_pitch_yaw(q: Quaternion) -> Vector:
    x, y, z, w = q
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0))
    yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


def degrees_e7(geodetic: Vector) -> tuple[int, int, int]:
    """Returns degE7, degE7, mm."""
    latitude, longitude, altitude = geodetic
    return round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3)


def clipped(value: float, bits: int) -> int:
    """Returns an integer that fits a signed field."""
    limit = (1 << bits - 1) - 1
    return max(-limit, min(limit, round(value)))


def _heading_cdeg(context: AutopilotContext) -> int:
    degrees = 90.0 - math.degrees(context.yaw)
    return round(degrees % 360.0 * 100.0) % 36000


def gps_raw_int(context: AutopilotContext) -> Any:
    """Returns GPS_RAW_INT from the estimate; without a fix if the UAV has lost its own."""
    position = degrees_e7(context.geodetic())
    north, east, _ = ned_of_enu(context.state.velocity)
    speed = math.hypot(north, east)
    course = round(math.degrees(math.atan2(east, north)) % 360.0 * 100.0) % 36000
    lost = context.memory.now_ns - context.memory.fix_ns > 1_000_000_000
    fix, satellites = (1, 0) if lost else (3, 10)
    return dialect().MAVLink_gps_raw_int_message(
        us(context),
        fix,
        *position,
        65535 if lost else 80,
        65535 if lost else 120,
        min(round(speed * 100.0), 65534),
        course if speed > 0.3 else 65535,
        satellites,
        position[2],
    )


def attitude(context: AutopilotContext) -> Any:
    """Returns ATTITUDE."""
    angles = _roll_pitch_yaw(q_ned_frd_of_enu_flu(context.state.attitude))
    return dialect().MAVLink_attitude_message(
        ms(context), *angles, *frd_of_flu(context.state.rates)
    )


def attitude_quaternion(context: AutopilotContext) -> Any:
    """Returns ATTITUDE_QUATERNION."""
    x, y, z, w = q_ned_frd_of_enu_flu(context.state.attitude)
    sign = -1.0 if w < 0.0 else 1.0
    turned = (sign * w, sign * x, sign * y, sign * z)
    rates = frd_of_flu(context.state.rates)
    return dialect().MAVLink_attitude_quaternion_message(ms(context), *turned, *rates)


def local_position(context: AutopilotContext) -> Any:
    """Returns LOCAL_POSITION_NED, from the vehicle's position at the start."""
    position, velocity = local_motion(context)
    return dialect().MAVLink_local_position_ned_message(ms(context), *position, *velocity)


def odometry(context: AutopilotContext) -> Any:
    """Returns ODOMETRY in the local frame, velocities too, as PX4 does; covariances are unknown."""
    position, velocity = local_motion(context)
    x, y, z, w = q_ned_frd_of_enu_flu(context.state.attitude)
    unknown = [math.nan] + [0.0] * 20
    return dialect().MAVLink_odometry_message(
        us(context),
        _LOCAL_NED,
        _LOCAL_NED,
        *position,
        [w, x, y, z],
        *velocity,
        *frd_of_flu(context.state.rates),
        unknown,
        unknown,
        0,
        _BY_AUTOPILOT,
    )


def global_position(context: AutopilotContext) -> Any:
    """Returns GLOBAL_POSITION_INT."""
    state = context.state
    home = context.memory.home_or_origin
    velocity = (clipped(part * 100.0, 16) for part in ned_of_enu(state.velocity))
    return dialect().MAVLink_global_position_int_message(
        ms(context),
        *degrees_e7(context.geodetic()),
        round((state.position[2] - home[2]) * 1e3),
        *velocity,
        _heading_cdeg(context),
    )


def highres_imu(context: AutopilotContext) -> Any:
    """Returns HIGHRES_IMU: specific force and rates of the controllers, standard pressure."""
    state = context.state
    altitude = state.position[2] + context.build.origin[2]
    force = specific_force(state)
    mbar = float(pressure(altitude)) / 100.0
    return dialect().MAVLink_highres_imu_message(
        us(context),
        *frd_of_flu(force),
        *frd_of_flu(state.rates),
        *(math.nan,) * 3,
        mbar,
        math.nan,
        altitude,
        math.nan,
        0x3F | 0xA00,
    )


def specific_force(state: FlightState) -> Vector:
    """Returns the specific force, m/s^2, body: the output of an ideal accelerometer."""
    x, y, z, w = state.attitude
    ax, ay, az = state.acceleration
    az += _GRAVITY
    tx, ty, tz = 2.0 * (z * ay - y * az), 2.0 * (x * az - z * ax), 2.0 * (y * ax - x * ay)
    return (
        ax + w * tx + z * ty - y * tz,
        ay + w * ty + x * tz - z * tx,
        az + w * tz + y * tx - x * ty,
    )


def scaled_pressure(context: AutopilotContext) -> Any:
    """Returns SCALED_PRESSURE of the barometer; None without a barometer."""
    memory = context.memory
    if not math.isfinite(memory.pressure):
        return None
    warmth = memory.air_temperature if math.isfinite(memory.air_temperature) else 0.0
    return dialect().MAVLink_scaled_pressure_message(
        ms(context), memory.pressure / 100.0, 0.0, clipped(warmth * 100.0, 16)
    )


def vfr_hud(context: AutopilotContext) -> Any:
    """Returns VFR_HUD."""
    state = context.state
    speed = math.hypot(*state.velocity[:2])
    throttle = round(100.0 * sum(state.rotors) / max(len(state.rotors), 1))
    altitude = state.position[2] + context.build.origin[2]
    return dialect().MAVLink_vfr_hud_message(
        speed, speed, _heading_cdeg(context) // 100, throttle, altitude, state.velocity[2]
    )


def altitude(context: AutopilotContext) -> Any:
    """Returns ALTITUDE."""
    z = context.state.position[2]
    home = context.memory.home_or_origin
    amsl = z + context.build.origin[2]
    local = z - context.memory.origin[2]
    return dialect().MAVLink_altitude_message(
        us(context), amsl, amsl, local, z - home[2], math.nan, math.nan
    )


def target_motion(context: AutopilotContext) -> list[float] | None:
    """Returns target position from the local origin, velocity, acceleration (NED), yaw, yaw rate.

    Unset values are nan; None without a target of motion.
    """
    target = context.memory.target
    if target is None or target.attitude is not None or target.rates is not None:
        return None
    origin = context.memory.origin
    x, y, z = (part - start for part, start in zip(target.position, origin, strict=True))
    vectors = (ned_of_enu((x, y, z)), ned_of_enu(target.velocity), ned_of_enu(target.acceleration))
    parts = [part for vector in vectors for part in vector]
    return [*parts, 0.5 * math.pi - target.yaw, -target.yaw_rate]


def position_target(context: AutopilotContext) -> Any:
    """Returns POSITION_TARGET_LOCAL_NED; None without a target."""
    parts = target_motion(context)
    if parts is None:
        return None
    bits = (1, 2, 4, 8, 16, 32, 64, 128, 256, 1024, 2048)
    mask = sum(bit for bit, part in zip(bits, parts, strict=True) if not math.isfinite(part))
    return dialect().MAVLink_position_target_local_ned_message(ms(context), 1, mask, *parts)


def attitude_target(context: AutopilotContext) -> Any:
    """Returns ATTITUDE_TARGET; None without a target attitude."""
    target = context.memory.target
    if target is None or (target.attitude is None and target.rates is None):
        return None
    x, y, z, w = q_ned_frd_of_enu_flu(target.attitude or (0.0, 0.0, 0.0, 1.0))
    mask = 7 if target.attitude is not None else 128
    rates = frd_of_flu(target.rates or (0.0, 0.0, 0.0))
    return dialect().MAVLink_attitude_target_message(
        ms(context), mask, [w, x, y, z], *rates, target.thrust
    )


def servo_output(context: AutopilotContext) -> Any:
    """Returns SERVO_OUTPUT_RAW: fractions of full speed as pulses of 1000 to 2000 us."""
    pulses = [round(1000.0 + 1000.0 * min(fraction, 1.0)) for fraction in context.state.rotors]
    pulses = (pulses + [0] * 16)[:16]
    return dialect().MAVLink_servo_output_raw_message(
        us(context) & 0xFFFFFFFF, 0, *pulses[:8], *pulses[8:]
    )
