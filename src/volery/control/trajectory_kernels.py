"""Trajectories as the fused step flies them: segments of polynomials, evaluated at guidance ticks.

A segment is a row of numbers: its begin and end, s after the trajectory's start, then the six
coefficients of x, y, z (m) and yaw (rad), in powers of the time since its begin. What is fed
forward is looked up one lag of the attitude loop ahead, since that is when it will act.
"""

from __future__ import annotations

import math
from typing import Any

from volery.vehicle.compiled import inner_kernel

BEGIN, END, FIRST = 0, 1, 2
"""Columns of a segment."""
ORDER = 6
"""Coefficients of a polynomial."""
SEGMENT_COLUMNS = FIRST + 4 * ORDER
_AT_REST_M_S = 0.05
"""A trajectory that ends slower than this is held where it ends, else the UAV brakes first."""


@inner_kernel
def polynomial(segments: Any, row: int, axis: int, t: float) -> tuple[float, float, float]:
    """Value and two derivatives of an axis (0 to 3: x, y, z, yaw), `t` s after the row's begin."""
    p, v, a = 0.0, 0.0, 0.0
    for k in range(ORDER - 1, -1, -1):
        a = a * t + v
        v = v * t + p
        p = p * t + segments[row, FIRST + ORDER * axis + k]
    return p, v, 2.0 * a


@inner_kernel
def segment_at(segments: Any, row: int, last: int, t: float) -> int:
    """The row, from `row` to `last`, in which `t` lies; a common end belongs to the later one."""
    while row < last and t >= segments[row, END]:
        row += 1
    return row


@inner_kernel
def path_time(pilot: Any, step: int, dt: float) -> float:
    """Time (s) since the start of what is followed."""
    time: float = (step - pilot.start_step) * dt
    return time


@inner_kernel
def path_is_flown(pilot: Any, paths: Any, step: int, dt: float) -> bool:
    """Whether a trajectory has ended; if so, what is held from now on is set."""
    end = paths[pilot.path_last, END]
    if path_time(pilot, step, dt) < end:
        return False
    speed = 0.0
    for k in range(3):
        p, v, _ = polynomial(paths, pilot.path_last, k, end - paths[pilot.path_last, BEGIN])
        pilot.position_target[k] = pilot.position[k] = p
        pilot.velocity[k] = v
        pilot.acceleration[k] = 0.0
        speed += v * v
    pilot.braking = speed > _AT_REST_M_S**2
    return True


@inner_kernel
def follow_path(
    pilot: Any, gains: Any, paths: Any, step: int, dt: float
) -> tuple[float, float, float, float]:
    """Put the reference where the trajectory is now; the yaw rate and acceleration to feed."""
    t = path_time(pilot, step, dt)
    last = pilot.path_last
    row = segment_at(paths, pilot.path_row, last, t)
    pilot.path_row = row
    begin = paths[row, BEGIN]
    for k in range(3):
        pilot.position[k], pilot.velocity[k], pilot.acceleration[k] = polynomial(
            paths, row, k, t - begin
        )
    rate = 0.0
    if pilot.path_faces:
        yaw, rate, _ = polynomial(paths, row, 3, t - begin)
        pilot.heading_target[0], pilot.heading_target[1] = math.cos(yaw), math.sin(yaw)
    t = min(t + gains.lead, paths[last, END])
    row = segment_at(paths, row, last, t)
    t -= paths[row, BEGIN]
    _, vx, ax = polynomial(paths, row, 0, t)
    _, vy, ay = polynomial(paths, row, 1, t)
    az = pilot.acceleration[2]  # thrust answers at once
    return rate, ax + gains.drag * vx, ay + gains.drag * vy, az


@inner_kernel
def follow_setpoint(
    pilot: Any, gains: Any, step: int, dt: float
) -> tuple[float, float, float, float]:
    """Like `follow_path` for a single setpoint, which moves on by its velocity and acceleration."""
    t = path_time(pilot, step, dt)
    for k in range(3):
        a = pilot.acceleration_target[k]
        pilot.acceleration[k] = a
        pilot.velocity[k] = pilot.velocity_target[k] + a * t
        pilot.position[k] = pilot.position_target[k] + t * (pilot.velocity_target[k] + 0.5 * a * t)
    rate = pilot.yaw_rate_target
    if not pilot.turning:
        turn = rate * gains.tick
        c, s = pilot.heading_target[0], pilot.heading_target[1]
        ct, st = math.cos(turn), math.sin(turn)
        pilot.heading_target[0], pilot.heading_target[1] = ct * c - st * s, ct * s + st * c
    drag = gains.drag
    return (
        rate,
        pilot.acceleration[0] + drag * pilot.velocity[0],
        pilot.acceleration[1] + drag * pilot.velocity[1],
        pilot.acceleration[2],
    )
