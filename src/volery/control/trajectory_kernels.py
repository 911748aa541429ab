"""Compiled trajectories: segments of polynomials, evaluated at guidance ticks.

A segment is a row of numbers: its begin and end, s after the trajectory's start, then the six
coefficients of x, y, z (m) and yaw (rad), in powers of the time since its begin. Feedforward is
evaluated one lag of the attitude loop ahead, the time at which it acts.
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
"""Final speed below which a UAV holds a trajectory's end; above it brakes first."""


@inner_kernel
def polynomial(segments: Any, row: int, axis: int, t: float) -> tuple[float, float, float]:
    """Returns value and two derivatives of axis 0 to 3 (x, y, z, yaw), `t` s after its begin."""
    p, v, a = 0.0, 0.0, 0.0
    for k in range(ORDER - 1, -1, -1):
        a = a * t + v
        v = v * t + p
        p = p * t + segments[row, FIRST + ORDER * axis + k]
    return p, v, 2.0 * a


@inner_kernel
def segment_at(segments: Any, row: int, last: int, t: float) -> int:
    """Returns the row, `row` to `last`, that contains `t`; a common end counts as the later's."""
    while row < last and t >= segments[row, END]:
        row += 1
    return row


@inner_kernel
def path_time(control_state: Any, step: int, dt: float) -> float:
    """Returns the time (s) since the start of the trajectory or setpoint."""
    time: float = (step - control_state.start_step) * dt
    return time


@inner_kernel
def path_is_flown(control_state: Any, paths: Any, step: int, dt: float) -> bool:
    """Returns whether a trajectory has ended; if so, sets the state to hold."""
    end = paths[control_state.path_last, END]
    if path_time(control_state, step, dt) < end:
        return False
    speed = 0.0
    for k in range(3):
        p, v, _ = polynomial(
            paths, control_state.path_last, k, end - paths[control_state.path_last, BEGIN]
        )
        control_state.position_target[k] = control_state.position[k] = p
        control_state.velocity[k] = v
        control_state.acceleration[k] = 0.0
        speed += v * v
    control_state.braking = speed > _AT_REST_M_S**2
    return True


@inner_kernel
def follow_path(
    control_state: Any, gains: Any, paths: Any, step: int, dt: float
) -> tuple[float, float, float, float]:
    """Moves the reference along the trajectory; returns feedforward yaw rate and acceleration."""
    t = path_time(control_state, step, dt)
    last = control_state.path_last
    row = segment_at(paths, control_state.path_row, last, t)
    control_state.path_row = row
    begin = paths[row, BEGIN]
    for k in range(3):
        control_state.position[k], control_state.velocity[k], control_state.acceleration[k] = (
            polynomial(paths, row, k, t - begin)
        )
    rate = 0.0
    if control_state.path_faces:
        yaw, rate, _ = polynomial(paths, row, 3, t - begin)
        control_state.heading_target[0], control_state.heading_target[1] = (
            math.cos(yaw),
            math.sin(yaw),
        )
    t = min(t + gains.lead, paths[last, END])
    row = segment_at(paths, row, last, t)
    t -= paths[row, BEGIN]
    _, vx, ax = polynomial(paths, row, 0, t)
    _, vy, ay = polynomial(paths, row, 1, t)
    az = control_state.acceleration[2]  # thrust acts at once
    return rate, ax + gains.drag * vx, ay + gains.drag * vy, az


@inner_kernel
def follow_setpoint(
    control_state: Any, gains: Any, step: int, dt: float
) -> tuple[float, float, float, float]:
    """Follows a single setpoint, which moves with its velocity, as `follow_path`."""
    t = path_time(control_state, step, dt)
    for k in range(3):
        a = control_state.acceleration_target[k]
        control_state.acceleration[k] = a
        control_state.velocity[k] = control_state.velocity_target[k] + a * t
        control_state.position[k] = control_state.position_target[k] + t * (
            control_state.velocity_target[k] + 0.5 * a * t
        )
    rate = control_state.yaw_rate_target
    if not control_state.turning:
        turn = rate * gains.tick
        c, s = control_state.heading_target[0], control_state.heading_target[1]
        ct, st = math.cos(turn), math.sin(turn)
        control_state.heading_target[0], control_state.heading_target[1] = (
            ct * c - st * s,
            ct * s + st * c,
        )
    drag = gains.drag
    return (
        rate,
        control_state.acceleration[0] + drag * control_state.velocity[0],
        control_state.acceleration[1] + drag * control_state.velocity[1],
        control_state.acceleration[2],
    )
