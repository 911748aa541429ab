"""Builds messages about a vehicle's motion: NED, FRD, MAVLink's units (degE7, mm, cm/s, mbar).

Unknown fields have the values that the dialect defines for this.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from volery.core.atmosphere import pressure
from volery.core.frames import frd_of_flu, ned_of_enu, q_ned_frd_of_enu_flu
from volery.mavlink.codec import dialect

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot
    from volery.mavlink.autopilot.vehicle import FlightState, Quaternion, Vector

_GRAVITY = 9.80665
_LOCAL_NED, _BY_AUTOPILOT = 1, 8
"""Values of MAV_FRAME and MAV_ESTIMATOR_TYPE."""


def ms(autopilot: Autopilot) -> int:
    """Returns milliseconds since the start."""
    return autopilot.memory.now_ns // 1_000_000 & 0xFFFFFFFF


def us(autopilot: Autopilot) -> int:
    """Returns microseconds since the start."""
    return autopilot.memory.now_ns // 1_000


def local_motion(autopilot: Autopilot) -> tuple[Vector, Vector]:
    """Returns position from the local origin and velocity, NED."""
    state, origin = autopilot.state, autopilot.memory.origin
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


def _heading_cdeg(autopilot: Autopilot) -> int:
    degrees = 90.0 - math.degrees(autopilot.yaw)
    return round(degrees % 360.0 * 100.0) % 36000


def gps_raw_int(autopilot: Autopilot) -> Any:
    """Returns GPS_RAW_INT from the estimate; without a fix if the UAV has lost its own."""
    place = degrees_e7(autopilot.geodetic())
    north, east, _ = ned_of_enu(autopilot.state.velocity)
    speed = math.hypot(north, east)
    course = round(math.degrees(math.atan2(east, north)) % 360.0 * 100.0) % 36000
    lost = autopilot.memory.now_ns - autopilot.memory.fix_ns > 1_000_000_000
    fix, satellites = (1, 0) if lost else (3, 10)
    return dialect().MAVLink_gps_raw_int_message(
        us(autopilot),
        fix,
        *place,
        65535 if lost else 80,
        65535 if lost else 120,
        min(round(speed * 100.0), 65534),
        course if speed > 0.3 else 65535,
        satellites,
        place[2],
    )


def attitude(autopilot: Autopilot) -> Any:
    """Returns ATTITUDE."""
    angles = _roll_pitch_yaw(q_ned_frd_of_enu_flu(autopilot.state.attitude))
    return dialect().MAVLink_attitude_message(
        ms(autopilot), *angles, *frd_of_flu(autopilot.state.rates)
    )


def attitude_quaternion(autopilot: Autopilot) -> Any:
    """Returns ATTITUDE_QUATERNION."""
    x, y, z, w = q_ned_frd_of_enu_flu(autopilot.state.attitude)
    sign = -1.0 if w < 0.0 else 1.0
    turned = (sign * w, sign * x, sign * y, sign * z)
    rates = frd_of_flu(autopilot.state.rates)
    return dialect().MAVLink_attitude_quaternion_message(ms(autopilot), *turned, *rates)


def local_position(autopilot: Autopilot) -> Any:
    """Returns LOCAL_POSITION_NED, from the vehicle's position at the start."""
    place, velocity = local_motion(autopilot)
    return dialect().MAVLink_local_position_ned_message(ms(autopilot), *place, *velocity)


def odometry(autopilot: Autopilot) -> Any:
    """Returns ODOMETRY in the local frame, velocities too, as PX4 does; covariances are unknown."""
    place, velocity = local_motion(autopilot)
    x, y, z, w = q_ned_frd_of_enu_flu(autopilot.state.attitude)
    unknown = [math.nan] + [0.0] * 20
    return dialect().MAVLink_odometry_message(
        us(autopilot),
        _LOCAL_NED,
        _LOCAL_NED,
        *place,
        [w, x, y, z],
        *velocity,
        *frd_of_flu(autopilot.state.rates),
        unknown,
        unknown,
        0,
        _BY_AUTOPILOT,
    )


def global_position(autopilot: Autopilot) -> Any:
    """Returns GLOBAL_POSITION_INT."""
    state = autopilot.state
    home = autopilot.memory.home or autopilot.memory.origin
    velocity = (clipped(part * 100.0, 16) for part in ned_of_enu(state.velocity))
    return dialect().MAVLink_global_position_int_message(
        ms(autopilot),
        *degrees_e7(autopilot.geodetic()),
        round((state.position[2] - home[2]) * 1e3),
        *velocity,
        _heading_cdeg(autopilot),
    )


def highres_imu(autopilot: Autopilot) -> Any:
    """Returns HIGHRES_IMU: specific force and rates of the controllers, standard pressure."""
    state = autopilot.state
    altitude = state.position[2] + autopilot.build.origin[2]
    force = specific_force(state)
    mbar = float(pressure(altitude)) / 100.0
    return dialect().MAVLink_highres_imu_message(
        us(autopilot),
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


def scaled_pressure(autopilot: Autopilot) -> Any:
    """Returns SCALED_PRESSURE of the barometer; None without a barometer."""
    memory = autopilot.memory
    if not math.isfinite(memory.pressure):
        return None
    warmth = memory.air_temperature if math.isfinite(memory.air_temperature) else 0.0
    return dialect().MAVLink_scaled_pressure_message(
        ms(autopilot), memory.pressure / 100.0, 0.0, clipped(warmth * 100.0, 16)
    )


def vfr_hud(autopilot: Autopilot) -> Any:
    """Returns VFR_HUD."""
    state = autopilot.state
    speed = math.hypot(*state.velocity[:2])
    throttle = round(100.0 * sum(state.rotors) / max(len(state.rotors), 1))
    altitude = state.position[2] + autopilot.build.origin[2]
    return dialect().MAVLink_vfr_hud_message(
        speed, speed, _heading_cdeg(autopilot) // 100, throttle, altitude, state.velocity[2]
    )


def altitude(autopilot: Autopilot) -> Any:
    """Returns ALTITUDE."""
    z = autopilot.state.position[2]
    home = autopilot.memory.home or autopilot.memory.origin
    amsl = z + autopilot.build.origin[2]
    local = z - autopilot.memory.origin[2]
    return dialect().MAVLink_altitude_message(
        us(autopilot), amsl, amsl, local, z - home[2], math.nan, math.nan
    )


def target_motion(autopilot: Autopilot) -> list[float] | None:
    """Returns target position from the local origin, velocity, acceleration (NED), yaw, yaw rate.

    Unset values are nan; None without a target of motion.
    """
    target = autopilot.memory.target
    if target is None or target.attitude is not None or target.rates is not None:
        return None
    origin = autopilot.memory.origin
    x, y, z = (part - start for part, start in zip(target.position, origin, strict=True))
    vectors = (ned_of_enu((x, y, z)), ned_of_enu(target.velocity), ned_of_enu(target.acceleration))
    parts = [part for vector in vectors for part in vector]
    return [*parts, 0.5 * math.pi - target.yaw, -target.yaw_rate]


def position_target(autopilot: Autopilot) -> Any:
    """Returns POSITION_TARGET_LOCAL_NED; None without a target."""
    parts = target_motion(autopilot)
    if parts is None:
        return None
    bits = (1, 2, 4, 8, 16, 32, 64, 128, 256, 1024, 2048)
    mask = sum(bit for bit, part in zip(bits, parts, strict=True) if not math.isfinite(part))
    return dialect().MAVLink_position_target_local_ned_message(ms(autopilot), 1, mask, *parts)


def attitude_target(autopilot: Autopilot) -> Any:
    """Returns ATTITUDE_TARGET; None without a target attitude."""
    target = autopilot.memory.target
    if target is None or (target.attitude is None and target.rates is None):
        return None
    x, y, z, w = q_ned_frd_of_enu_flu(target.attitude or (0.0, 0.0, 0.0, 1.0))
    mask = 7 if target.attitude is not None else 128
    rates = frd_of_flu(target.rates or (0.0, 0.0, 0.0))
    return dialect().MAVLink_attitude_target_message(
        ms(autopilot), mask, [w, x, y, z], *rates, target.thrust
    )


def servo_output(autopilot: Autopilot) -> Any:
    """Returns SERVO_OUTPUT_RAW: fractions of full speed as pulses of 1000 to 2000 us."""
    pulses = [round(1000.0 + 1000.0 * min(share, 1.0)) for share in autopilot.state.rotors]
    pulses = (pulses + [0] * 16)[:16]
    return dialect().MAVLink_servo_output_raw_message(
        us(autopilot) & 0xFFFFFFFF, 0, *pulses[:8], *pulses[8:]
    )
