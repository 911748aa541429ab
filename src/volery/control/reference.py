"""The reference of the outer loop: consistent position, velocity and acceleration.

At each guidance tick the reference advances by the acceleration of the last one, then a new
acceleration is chosen. Towards a position it follows a braking profile (proportional near the goal,
the square root of the distance farther out); acceleration and jerk are limited, so that the vehicle
can follow. A leash limits the distance of the reference from a vehicle that is held back: to that
at which the position term of the law requires the whole acceleration.
"""

from __future__ import annotations

import math
from typing import Any

from volery.vehicle.compiled import inner_kernel


@inner_kernel
def move_on(control_state: Any, gains: Any) -> None:
    """Advances the reference of a `CONTROL_STATE` from the last guidance tick to this one."""
    tick = gains.tick
    for k in range(3):
        change = tick * control_state.acceleration[k]
        control_state.position[k] += tick * (control_state.velocity[k] + 0.5 * change)
        control_state.velocity[k] += change


@inner_kernel
def approach(
    distance: float, gain: float, brake: float, linear: float, limit: float
) -> tuple[float, float]:
    """Returns the speed (m/s) at `distance` m from a goal, and its derivative by distance (1/s).

    `brake` (m/s^2) stops from that speed; within `linear` = brake / gain^2 of the goal the speed is
    proportional to the distance.
    """
    if distance <= linear:
        speed, slope = gain * distance, gain
    else:
        speed = math.sqrt(2.0 * brake * (distance - 0.5 * linear))
        slope = brake / speed
    return (speed, slope) if speed < limit else (limit, 0.0)


@inner_kernel
def lead_level(control_state: Any, estimate: Any, gains: Any, speed: float) -> None:
    """Chooses the horizontal acceleration to reach `position_target` at up to `speed` m/s."""
    dx = control_state.position[0] - estimate.position_map[0]
    dy = control_state.position[1] - estimate.position_map[1]
    square = dx * dx + dy * dy
    if square > gains.level_leash * gains.level_leash:
        factor = gains.level_leash / math.sqrt(square)
        control_state.position[0] = estimate.position_map[0] + factor * dx
        control_state.position[1] = estimate.position_map[1] + factor * dy
    vx, vy = control_state.velocity[0], control_state.velocity[1]
    dx = control_state.position_target[0] - control_state.position[0]
    dy = control_state.position_target[1] - control_state.position[1]
    distance = math.sqrt(dx * dx + dy * dy)
    ax, ay = -gains.ease * vx, -gains.ease * vy
    if distance > 1e-9:
        wanted, slope = approach(distance, gains.position, gains.brake, gains.level_linear, speed)
        inverse = 1.0 / distance
        nx, ny = inverse * dx, inverse * dy
        along = nx * vx + ny * vy
        # the change of the desired velocity along the path, and the error to it
        turn = inverse * wanted
        ahead = (turn - slope) * along
        ax += (gains.ease * wanted + ahead) * nx - turn * vx
        ay += (gains.ease * wanted + ahead) * ny - turn * vy
    _choose_level(control_state, gains, ax, ay, gains.acceleration * gains.ease * gains.tick)


@inner_kernel
def lead_height(
    control_state: Any, estimate: Any, gains: Any, climb: float, descent: float
) -> None:
    """Chooses the vertical acceleration to reach `position_target`, limits in m/s."""
    ahead = control_state.position[2] - estimate.position_map[2]
    ahead = min(max(ahead, -gains.height_leash), gains.height_leash)
    control_state.position[2] = estimate.position_map[2] + ahead
    dz = control_state.position_target[2] - control_state.position[2]
    limit = climb if dz > 0.0 else descent
    wanted, slope = approach(
        abs(dz), gains.position, gains.height_brake, gains.height_linear, limit
    )
    vz = control_state.velocity[2]
    az = gains.ease * (math.copysign(wanted, dz) - vz) - slope * vz
    _choose_height(control_state, gains, az, gains.climb_acceleration * gains.ease * gains.tick)


@inner_kernel
def steer_level(control_state: Any, estimate: Any, gains: Any, tx: float, ty: float) -> None:
    """Chooses the horizontal acceleration to reach the velocity (tx, ty) m/s.

    The position of the reference is the vehicle's own: positions do not count.
    """
    rate = gains.inverse_tick
    ax, ay = rate * (tx - control_state.velocity[0]), rate * (ty - control_state.velocity[1])
    _choose_level(control_state, gains, ax, ay, math.inf)
    control_state.position[0] = estimate.position_map[0]
    control_state.position[1] = estimate.position_map[1]


@inner_kernel
def steer_height(control_state: Any, estimate: Any, gains: Any, tz: float) -> None:
    """Chooses the vertical acceleration for velocity tz, as `steer_level`."""
    _choose_height(
        control_state, gains, gains.inverse_tick * (tz - control_state.velocity[2]), math.inf
    )
    control_state.position[2] = estimate.position_map[2]


@inner_kernel
def brake_level(control_state: Any, estimate: Any, gains: Any) -> None:
    """Chooses the horizontal acceleration of gentle braking to rest; positions do not count."""
    ax, ay = -gains.ease * control_state.velocity[0], -gains.ease * control_state.velocity[1]
    _choose_level(control_state, gains, ax, ay, gains.acceleration * gains.ease * gains.tick)
    control_state.position[0] = estimate.position_map[0]
    control_state.position[1] = estimate.position_map[1]


@inner_kernel
def brake_height(control_state: Any, estimate: Any, gains: Any) -> None:
    """Brakes vertically, as `brake_level`."""
    az = -gains.ease * control_state.velocity[2]
    _choose_height(control_state, gains, az, gains.climb_acceleration * gains.ease * gains.tick)
    control_state.position[2] = estimate.position_map[2]


@inner_kernel
def _choose_level(control_state: Any, gains: Any, ax: float, ay: float, max_change: float) -> None:
    square = ax * ax + ay * ay
    if square > gains.acceleration * gains.acceleration:
        factor = gains.acceleration / math.sqrt(square)
        ax *= factor
        ay *= factor
    dx, dy = ax - control_state.acceleration[0], ay - control_state.acceleration[1]
    square = dx * dx + dy * dy
    factor = max_change / math.sqrt(square) if square > max_change * max_change else 1.0
    control_state.acceleration[0] += factor * dx
    control_state.acceleration[1] += factor * dy


@inner_kernel
def _choose_height(control_state: Any, gains: Any, az: float, max_change: float) -> None:
    az = min(max(az, -gains.climb_acceleration), gains.climb_acceleration)
    change = az - control_state.acceleration[2]
    control_state.acceleration[2] += min(max(change, -max_change), max_change)
