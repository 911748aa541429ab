"""The outer loop, run at guidance ticks: attitude and thrust from a reference.

Where positions count, the law is robust and perfect tracking (`control.rpt`); where only velocities
count, the same law without its position term. The airframe's rotor drag at hover speed is fed
forward with the acceleration (M. Faessler et al., arXiv 1712.02402). Height has priority: at the
limits of thrust or tilt the horizontal acceleration is reduced. Integrals are accelerations that
compensate for steady disturbances: they stop where they would push further into a limit, are
bounded, and pass unchanged from one law to the other. A vehicle farther than its leash from the
reference's position returns at a steady speed: there the integrals use the velocity error, since
the distance would wind them up.
"""

from __future__ import annotations

import math
from typing import Any

from volery.vehicle.airframe import GRAVITY
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.rotation_math import four, three

_FAR = 0.999
"""Fraction of the leash beyond which a reference counts as at its end."""


@inner_kernel
def track(
    control_state: Any,
    estimate: Any,
    gains: Any,
    level_placed: bool,
    height_placed: bool,
    fx: float,
    fy: float,
    fz: float,
) -> None:
    """Computes attitude and thrust setpoints that track the reference.

    level_placed, height_placed: whether positions count, horizontally and vertically. (fx, fy, fz):
    feedforward acceleration, m/s^2, map.
    """
    ex, ey, ez = _velocity_error(control_state, estimate)
    ix, iy, iz = three(control_state.velocity_integral)
    if level_placed:
        fx += gains.level_velocity * ex + ix
        fy += gains.level_velocity * ey + iy
        vx, vy = ex, ey
        ex, ey, far = _level_error(control_state, estimate, gains)
        ax, ay = fx + gains.level_position * ex, fy + gains.level_position * ey
        if far:
            factor = gains.level_velocity / gains.level_position
            ex += factor * vx
            ey += factor * vy
        level_learning = gains.level_integral
    else:
        ax, ay = fx + gains.velocity * ex + ix, fy + gains.velocity * ey + iy
        level_learning = gains.velocity_integral
    if height_placed:
        vz = ez
        ez, far = _height_error(control_state, estimate, gains)
        az = fz + gains.height_velocity * vz + gains.height_position * ez + iz + GRAVITY
        if far:
            ez += gains.height_velocity / gains.height_position * vz
        learning = gains.height_integral
    else:
        az = fz + gains.vertical * ez + iz + GRAVITY
        learning = gains.vertical_integral

    # height first
    min_az, max_az = gains.min_acceleration, gains.max_acceleration
    free_z = (az < max_az or ez < 0.0) and (az > min_az or ez > 0.0)
    az = min(max(az, min_az), max_az)
    max_size = min(gains.tilt_tangent * az, math.sqrt(max(max_az * max_az - az * az, 0.0)))
    size = math.sqrt(ax * ax + ay * ay)
    free_xy = True
    if size > max_size:
        free_xy = ax * ex + ay * ey < 0.0
        factor = max_size / size
        ax *= factor
        ay *= factor
    bound = gains.integral_limit
    if free_xy:
        gain = level_learning * gains.tick
        control_state.velocity_integral[0] = min(max(ix + gain * ex, -bound), bound)
        control_state.velocity_integral[1] = min(max(iy + gain * ey, -bound), bound)
    if free_z:
        gain = learning * gains.tick
        control_state.velocity_integral[2] = min(max(iz + gain * ez, -bound), bound)
    _point_thrust(control_state, estimate, gains, ax, ay, az)


@inner_kernel
def _velocity_error(control_state: Any, estimate: Any) -> tuple[float, float, float]:
    vx, vy, vz = three(estimate.velocity_map)
    return (
        control_state.velocity[0] - vx,
        control_state.velocity[1] - vy,
        control_state.velocity[2] - vz,
    )


@inner_kernel
def _level_error(control_state: Any, estimate: Any, gains: Any) -> tuple[float, float, bool]:
    """Returns the vector (m) to the reference, limited by the leash; whether it is at its end."""
    ex = control_state.position[0] - estimate.position_map[0]
    ey = control_state.position[1] - estimate.position_map[1]
    square = ex * ex + ey * ey
    near = _FAR * gains.level_leash
    if square <= near * near:
        return ex, ey, False
    factor = min(gains.level_leash / math.sqrt(square), 1.0)
    return factor * ex, factor * ey, True


@inner_kernel
def _height_error(control_state: Any, estimate: Any, gains: Any) -> tuple[float, bool]:
    """Returns the vertical error, as `_level_error`."""
    ez = control_state.position[2] - estimate.position_map[2]
    limit = gains.height_leash
    return min(max(ez, -limit), limit), abs(ez) > _FAR * limit


@inner_kernel
def _point_thrust(
    control_state: Any, estimate: Any, gains: Any, ax: float, ay: float, az: float
) -> None:
    """Computes thrust and attitude: z axis (ax, ay, az), az > 0, and the heading setpoint."""
    k = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
    zx, zy, zz = ax * k, ay * k, az * k
    # shortest rotation from the map's z to (zx, zy, zz)
    k = 1.0 / math.sqrt(2.0 * (1.0 + zz))
    px, py, pw = -zy * k, zx * k, (1.0 + zz) * k
    # turn about z after which the x axis, seen from above, points along the heading
    m = 2.0 * k * k
    c, s = control_state.heading[0], control_state.heading[1]
    cy = (1.0 - zy * zy * m) * c + zx * zy * m * s
    sy = zx * zy * m * c + (1.0 - zx * zx * m) * s
    k = 1.0 / math.sqrt(cy * cy + sy * sy)
    cy *= k
    sy *= k
    if cy >= 0.0:
        hw = math.sqrt(0.5 * (1.0 + cy))
        hz = 0.5 * sy / hw
    else:
        hz = math.sqrt(0.5 * (1.0 - cy))
        hw = 0.5 * sy / hz
    control_state.attitude[0] = px * hw + py * hz
    control_state.attitude[1] = py * hw - px * hz
    control_state.attitude[2] = pw * hz
    control_state.attitude[3] = pw * hw
    # thrust: the component of the desired acceleration along the present thrust axis
    qx, qy, qz, qw = four(estimate.attitude)
    along = (
        ax * 2.0 * (qx * qz + qy * qw)
        + ay * 2.0 * (qy * qz - qx * qw)
        + az * (1.0 - 2.0 * (qx * qx + qy * qy))
    )
    control_state.thrust = min(max(gains.mass * along, gains.min_thrust), gains.max_thrust)
