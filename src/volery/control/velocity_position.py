"""The outer layers, run at guidance ticks: position to velocity to acceleration to attitude.

Speeds towards a place follow a braking profile (proportional near the goal, the square root of
the distance farther out). Setpoints move no faster than the acceleration limit; their change and
the rotors' drag at hover speed are fed forward (M. Faessler et al., arXiv 1712.02402), and a
proportional-integral law turns velocity errors into accelerations. Height has
priority: where thrust or tilt are at their limits, the horizontal acceleration gives way, and
integrals stop where they would push further into a limit.
"""

from __future__ import annotations

import math
from typing import Any

from volery.vehicle.airframe import GRAVITY
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.rigid import four, three


@inner_kernel
def approach_speed(distance: float, gain: float, brake: float, limit: float) -> float:
    """Speed (m/s) towards a goal `distance` m away from which `brake` (m/s^2) still stops."""
    linear = brake / (gain * gain)
    if distance <= linear:
        return min(gain * distance, limit)
    return min(math.sqrt(2.0 * brake * (distance - 0.5 * linear)), limit)


@inner_kernel
def velocity_towards(
    pilot: Any, estimate: Any, gains: Any, speed: float, climb: float, descent: float
) -> tuple[float, float, float]:
    """Velocity (m/s, map) that leads from the present place to `position_target`."""
    dx = pilot.position_target[0] - estimate.position_map[0]
    dy = pilot.position_target[1] - estimate.position_map[1]
    dz = pilot.position_target[2] - estimate.position_map[2]
    distance = math.sqrt(dx * dx + dy * dy)
    scale = gains.position
    if distance > 1e-9:
        scale = approach_speed(distance, gains.position, gains.brake, speed) / distance
    limit = climb if dz > 0.0 else descent
    vz = approach_speed(abs(dz), gains.position, 0.6 * gains.climb_acceleration, limit)
    return scale * dx, scale * dy, math.copysign(vz, dz)


@inner_kernel
def track_velocity(pilot: Any, estimate: Any, gains: Any, tx: float, ty: float, tz: float) -> None:
    """Attitude and thrust setpoints that bring the velocity to (tx, ty, tz) m/s, map."""
    tick, rate = gains.tick, gains.inverse_tick
    # move the setpoint towards its target
    sx, sy, sz = three(pilot.velocity)
    dx, dy = tx - sx, ty - sy
    size = math.sqrt(dx * dx + dy * dy)
    most = gains.acceleration * tick
    if size > most:
        share = most / size
        dx *= share
        dy *= share
    most = gains.climb_acceleration * tick
    dz = min(max(tz - sz, -most), most)
    sx, sy, sz = sx + dx, sy + dy, sz + dz
    pilot.velocity[0], pilot.velocity[1], pilot.velocity[2] = sx, sy, sz

    # acceleration wanted
    ex = sx - estimate.velocity_map[0]
    ey = sy - estimate.velocity_map[1]
    ez = sz - estimate.velocity_map[2]
    k = gains.velocity
    ix, iy, iz = three(pilot.velocity_integral)
    ax = k * ex + ix + dx * rate + gains.drag * sx
    ay = k * ey + iy + dy * rate + gains.drag * sy
    az = gains.vertical * ez + iz + dz * rate + GRAVITY

    # height first
    least, most = gains.least_acceleration, gains.most_acceleration
    free_z = (az < most or ez < 0.0) and (az > least or ez > 0.0)
    az = min(max(az, least), most)
    reach = min(gains.tilt_tangent * az, math.sqrt(max(most * most - az * az, 0.0)))
    size = math.sqrt(ax * ax + ay * ay)
    free_xy = True
    if size > reach:
        free_xy = ax * ex + ay * ey < 0.0
        share = reach / size
        ax *= share
        ay *= share
    gain = gains.velocity_integral * tick
    bound = gains.integral_limit
    if free_xy:
        pilot.velocity_integral[0] = min(max(ix + gain * ex, -bound), bound)
        pilot.velocity_integral[1] = min(max(iy + gain * ey, -bound), bound)
    if free_z:
        gain = gains.vertical_integral * tick
        pilot.velocity_integral[2] = min(max(iz + gain * ez, -bound), bound)
    _point_thrust(pilot, estimate, gains, ax, ay, az)


@inner_kernel
def _point_thrust(pilot: Any, estimate: Any, gains: Any, ax: float, ay: float, az: float) -> None:
    """Attitude whose z axis lies along (ax, ay, az), az > 0, with the heading setpoint; thrust."""
    k = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
    zx, zy, zz = ax * k, ay * k, az * k
    # shortest turn that takes the map's z to (zx, zy, zz)
    k = 1.0 / math.sqrt(2.0 * (1.0 + zz))
    px, py, pw = -zy * k, zx * k, (1.0 + zz) * k
    # turn about z after which the x axis, seen from above, points along the heading
    m = 2.0 * k * k
    c, s = pilot.heading[0], pilot.heading[1]
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
    pilot.attitude[0] = px * hw + py * hz
    pilot.attitude[1] = py * hw - px * hz
    pilot.attitude[2] = pw * hz
    pilot.attitude[3] = pw * hw
    # thrust: the part of the wanted acceleration that the present thrust axis can give
    qx, qy, qz, qw = four(estimate.attitude)
    along = (
        ax * 2.0 * (qx * qz + qy * qw)
        + ay * 2.0 * (qy * qz - qx * qw)
        + az * (1.0 - 2.0 * (qx * qx + qy * qy))
    )
    pilot.thrust = min(max(gains.mass * along, gains.least_thrust), gains.most_thrust)


@inner_kernel
def heading_of(estimate: Any) -> tuple[float, float]:
    """Cosine and sine of the present heading; (0, 0) where the x axis points straight up."""
    x, y, z, w = four(estimate.attitude)
    c, s = 1.0 - 2.0 * (y * y + z * z), 2.0 * (w * z + x * y)
    n = math.sqrt(c * c + s * s)
    if n < 1e-6:
        return 0.0, 0.0
    return c / n, s / n


@inner_kernel
def turn_heading(pilot: Any, estimate: Any, gains: Any) -> None:
    """Move the heading setpoint by its rate, or towards its target; set the rate fed forward."""
    c, s = pilot.heading[0], pilot.heading[1]
    most = gains.yaw_rate_limit * gains.tick
    if pilot.turning:
        step = min(max(pilot.yaw_rate_target * gains.tick, -most), most)
        hc, hs = heading_of(estimate)
        # wait for a vehicle that has fallen 30 degrees behind
        if c * hc + s * hs < 0.866 and step * (hc * s - hs * c) > 0.0:
            step = 0.0
    else:
        gc, gs = pilot.heading_target[0], pilot.heading_target[1]
        step = c * gs - s * gc  # the sine of the angle left
        if c * gc + s * gs < 0.0:
            step = math.copysign(1.0, step)
        step = min(max(gains.yaw * gains.tick * step, -most), most)
    # a turn by the small angle `step`, up to step^3 / 6, kept to unit length by a Newton step
    turn = 1.0 - 0.5 * step * step
    c, s = c * turn - s * step, s * turn + c * step
    n = 1.5 - 0.5 * (c * c + s * s)
    pilot.heading[0], pilot.heading[1] = n * c, n * s
    pilot.yaw_rate = step * gains.inverse_tick
