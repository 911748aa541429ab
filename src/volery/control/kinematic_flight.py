"""Flight modes of kinematic UAVs, which follow their reference exactly."""

from __future__ import annotations

import math
from typing import Any

from volery.control.estimated_state import believe_attitude, believe_position
from volery.control.flight_modes import (
    LAND,
    LANDED,
    TRAJECTORY,
    VELOCITY,
    plan,
    stop,
    wanted_velocity,
)
from volery.control.heading import heading_of
from volery.control.pose_stream import NO_DEADLINE, STOP_S
from volery.control.setpoints import ControlLevel
from volery.control.trajectory_kernels import END, path_time, polynomial, segment_at
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.kinematic import drive, face, glide, put, stop_at_ground, turn_by
from volery.vehicle.rotation_math import three
from volery.world.terrain import TerrainGrid

_STOPPED = int(ControlLevel.STOPPED)
_POSE = int(ControlLevel.POSE)


@inner_kernel
def fly_kinematic(
    body: Any,
    control_state: Any,
    belief: Any,
    plant: Any,
    model: Any,
    gains: Any,
    paths: Any,
    grid: TerrainGrid,
    steepest: float,
    step: int,
    guiding: bool,
    dt: float,
) -> int:
    """Computes control and motion of a kinematic UAV for one step; returns its ground contact.

    model: a `KINEMATIC` row. guiding: whether this step begins with a guidance tick.
    """
    if control_state.level == _STOPPED:
        _rest(body, plant)
        return 0
    for r in range(plant.rotors):
        body.rotor_speed[r] = model.hover_speed
    if control_state.level == _POSE:
        _take_pose(body, control_state, step, dt)
        return stop_at_ground(body, plant, model, grid, steepest, step + 1, dt)
    if guiding:
        for k in range(3):
            control_state.position[k] = body.position_map[k]
            control_state.velocity[k] = body.velocity_map[k]
        control_state.heading[0], control_state.heading[1] = heading_of(body)
        believe_position(belief, body)
        believe_attitude(belief, body, control_state.errs)
        plan(control_state, belief, gains, paths, step, dt)
    if control_state.mode == VELOCITY:
        _follow_velocity(body, control_state, model, gains, dt)
    elif control_state.mode == TRAJECTORY:
        _follow_trajectory(body, control_state, paths, step, dt)
    else:
        ax, ay, az = three(control_state.acceleration)
        glide(body, ax, ay, az, dt)
        turn_by(body, control_state.yaw_rate, dt)
    touch = stop_at_ground(body, plant, model, grid, steepest, step + 1, dt)
    if body.on_ground and control_state.mode == LAND:
        stop(control_state)
        control_state.mode = LANDED
    return touch


@inner_kernel
def _rest(body: Any, plant: Any) -> None:
    """Stops the UAV and puts it to sleep until the next command."""
    for k in range(3):
        body.velocity_map[k] = body.omega_body[k] = 0.0
        body.acceleration_map[k] = body.angular_acceleration_body[k] = 0.0
    for r in range(plant.rotors):
        body.rotor_speed[r] = 0.0
    body.asleep = True


@inner_kernel
def _take_pose(body: Any, control_state: Any, step: int, dt: float) -> None:
    """Takes the commanded pose; velocity and rates reach theirs evenly in `pose_steps`."""
    if step >= control_state.deadline_step:
        for k in range(3):
            control_state.velocity_target[k] = control_state.rates[k] = 0.0
        control_state.deadline_step = NO_DEADLINE
        control_state.pose_steps = max(1, round(STOP_S / dt))
    left = max(control_state.pose_steps, 1)
    vx, vy, vz = three(body.velocity_map)
    vx += (control_state.velocity_target[0] - vx) / left
    vy += (control_state.velocity_target[1] - vy) / left
    vz += (control_state.velocity_target[2] - vz) / left
    px, py, pz = three(control_state.position_target)
    put(body, px, py, pz, vx, vy, vz, dt)
    for k in range(4):
        body.attitude[k] = control_state.attitude[k]
    for k in range(3):
        change = (control_state.rates[k] - body.omega_body[k]) / left
        body.angular_acceleration_body[k] = change / dt
        body.omega_body[k] += change
    if control_state.pose_steps == 0:  # a jump is no acceleration
        for k in range(3):
            body.acceleration_map[k] = body.angular_acceleration_body[k] = 0.0
    control_state.pose_steps = max(left - 1, 1)


@inner_kernel
def _follow_velocity(body: Any, control_state: Any, model: Any, gains: Any, dt: float) -> None:
    """Follows the commanded velocity, at once or with a lag, and moves the reference along."""
    if model.limited:
        tx, ty, tz = wanted_velocity(control_state, body, gains)
    else:
        tx, ty, tz = three(control_state.velocity_target)
        if control_state.velocity_in_heading:
            c, s = heading_of(body)
            tx, ty = c * tx - s * ty, s * tx + c * ty
    rate = control_state.yaw_rate
    if control_state.turning:
        rate = control_state.yaw_rate_target
        if model.limited:
            rate = min(max(rate, -gains.yaw_rate_limit), gains.yaw_rate_limit)
        rate += model.left * (body.omega_body[2] - rate)
    tx += model.left * (body.velocity_map[0] - tx)
    ty += model.left * (body.velocity_map[1] - ty)
    tz += model.left * (body.velocity_map[2] - tz)
    if control_state.velocity_in_heading:
        c, s = heading_of(body)
        drive(body, c * tx + s * ty, c * ty - s * tx, tz, rate, dt)
    else:
        px, py, pz = three(body.position_map)
        put(body, px + dt * tx, py + dt * ty, pz + dt * tz, tx, ty, tz, dt)
        turn_by(body, rate, dt)
    for k in range(3):
        control_state.acceleration[k] = 0.0


@inner_kernel
def _follow_trajectory(body: Any, control_state: Any, paths: Any, step: int, dt: float) -> None:
    """Moves the UAV to the trajectory or the moving setpoint at the step's end."""
    t = path_time(control_state, step + 1, dt)
    if control_state.path_last < 0:
        p, v, a = (
            control_state.position_target,
            control_state.velocity_target,
            control_state.acceleration_target,
        )
        h = 0.5 * t
        put(
            body,
            p[0] + t * (v[0] + h * a[0]),
            p[1] + t * (v[1] + h * a[1]),
            p[2] + t * (v[2] + h * a[2]),
            v[0] + t * a[0],
            v[1] + t * a[1],
            v[2] + t * a[2],
            dt,
        )
        turn_by(body, control_state.yaw_rate, dt)
        return
    t = min(t, paths[control_state.path_last, END])
    row = segment_at(paths, control_state.path_row, control_state.path_last, t)
    t -= paths[row, 0]
    px, vx, _ = polynomial(paths, row, 0, t)
    py, vy, _ = polynomial(paths, row, 1, t)
    pz, vz, _ = polynomial(paths, row, 2, t)
    put(body, px, py, pz, vx, vy, vz, dt)
    if control_state.path_faces:
        yaw, rate, _ = polynomial(paths, row, 3, t)
        face(body, math.cos(yaw), math.sin(yaw), rate, dt)
    else:
        turn_by(body, control_state.yaw_rate, dt)
