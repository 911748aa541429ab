"""One step of the plant: rotors, air, gravity, ground, and the rigid body's motion.

Velocity Verlet in its one-evaluation form: forces are taken once, at mid-step, from velocity,
rates and attitude extrapolated half a step and from the rotors' exact mid-step speeds; the velocity
takes the whole step with them, the position goes with the mean of old and new velocity, and the
attitude turns by the exponential of the mean rate. Second order in the step wherever commands and
contacts leave the motion smooth.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inline_kernel
from volery.vehicle.aerodynamics import air_wrench
from volery.vehicle.airframe import GRAVITY
from volery.vehicle.contact import NO_TOUCH, classify_touch, resolve_contact
from volery.world.terrain import TerrainGrid, terrain_height

Array = NDArray[np.float64]

_GROUND_MARGIN = 0.05
"""m kept when the next look at the terrain is put off."""
_STILL_SPEED = 0.03
"""m/s, and rad/s, below which a body on the ground counts as still ..."""
_STILL_S = 0.25
"""... and the s for which it must be so before it sleeps."""
_WRECK_DAMPING_S = 0.15
"""s: time constant with which a wreck on the ground loses its motion (modelling choice)."""


@inline_kernel
def step_body(
    body: Any,
    plant: Any,
    reference: Array,
    wind_x: float,
    wind_y: float,
    wind_z: float,
    grid: TerrainGrid,
    steepest: float,
    bounce: bool,
    scratch: Array,
    step: int,
    dt: float,
) -> int:
    """Move one `BODY` on by `dt` s; returns `NO_TOUCH`, `TOUCH_DOWN` or `IMPACT`.

    reference: (MAX_ROTORS,) rad/s, held over the step. wind: m/s, map. steepest: cosine of the
    terrain's steepest slope. step: number of the step that ends here.
    """
    half = 0.5 * dt
    position, velocity, attitude, omega = (
        body.position_map,
        body.velocity_map,
        body.attitude,
        body.omega_body,
    )
    vx0, vy0, vz0 = velocity[0], velocity[1], velocity[2]
    ox0, oy0, oz0 = omega[0], omega[1], omega[2]
    qx, qy, qz, qw = attitude[0], attitude[1], attitude[2], attitude[3]

    # mid-step, extrapolated
    ox = ox0 + half * body.free_angular_acceleration[0]
    oy = oy0 + half * body.free_angular_acceleration[1]
    oz = oz0 + half * body.free_angular_acceleration[2]
    ax = vx0 + half * body.free_acceleration[0] - wind_x
    ay = vy0 + half * body.free_acceleration[1] - wind_y
    az = vz0 + half * body.free_acceleration[2] - wind_z
    mx, my, mz, mw = _turned(qx, qy, qz, qw, 0.5 * half * ox, 0.5 * half * oy, 0.5 * half * oz)
    r00, r01, r02 = (
        1.0 - 2.0 * (my * my + mz * mz),
        2.0 * (mx * my - mz * mw),
        2.0 * (mx * mz + my * mw),
    )
    r10, r11, r12 = (
        2.0 * (mx * my + mz * mw),
        1.0 - 2.0 * (mx * mx + mz * mz),
        2.0 * (my * mz - mx * mw),
    )
    r20, r21, r22 = (
        2.0 * (mx * mz - my * mw),
        2.0 * (my * mz + mx * mw),
        1.0 - 2.0 * (mx * mx + my * my),
    )
    fx, fy, fz, tx, ty, tz = air_wrench(
        plant,
        body.rotor_speed,
        reference,
        r00 * ax + r10 * ay + r20 * az,
        r01 * ax + r11 * ay + r21 * az,
        r02 * ax + r12 * ay + r22 * az,
        ox,
        oy,
        oz,
    )
    light = 1.0 / plant.mass
    ax = (r00 * fx + r01 * fy + r02 * fz) * light
    ay = (r10 * fx + r11 * fy + r12 * fz) * light
    az = (r20 * fx + r21 * fy + r22 * fz) * light - GRAVITY
    ix, iy, iz = plant.inertia[0], plant.inertia[1], plant.inertia[2]
    bx = (tx - (iz - iy) * oy * oz) / ix
    by = (ty - (ix - iz) * oz * ox) / iy
    bz = (tz - (iy - ix) * ox * oy) / iz
    body.free_acceleration[0], body.free_acceleration[1], body.free_acceleration[2] = ax, ay, az
    body.free_angular_acceleration[0] = bx
    body.free_angular_acceleration[1] = by
    body.free_angular_acceleration[2] = bz
    velocity[0], velocity[1], velocity[2] = vx0 + dt * ax, vy0 + dt * ay, vz0 + dt * az
    omega[0], omega[1], omega[2] = ox0 + dt * bx, oy0 + dt * by, oz0 + dt * bz
    speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2)

    # the ground, looked up only when it may be within reach
    touch = NO_TOUCH
    lag = half
    travel = speed * dt
    body.ground_budget -= travel
    if body.ground_budget < travel + _GROUND_MARGIN:
        height = position[2] - terrain_height(grid, position[0], position[1])
        body.ground_budget = height * steepest - plant.contact_radius
        if body.ground_budget < travel + _GROUND_MARGIN:
            approach = resolve_contact(body, plant, grid, bounce, scratch, dt)
            body.on_ground = approach >= 0.0
            if body.on_ground:
                lag = dt
                touch = classify_touch(body, plant, approach, speed, step, dt, bounce)
                if body.crashed:
                    keep = 1.0 - dt / _WRECK_DAMPING_S
                    for k in range(3):
                        velocity[k] *= keep
                        omega[k] *= keep
                ax, ay, az = (
                    (velocity[0] - vx0) / dt,
                    (velocity[1] - vy0) / dt,
                    (velocity[2] - vz0) / dt,
                )
                bx, by, bz = (omega[0] - ox0) / dt, (omega[1] - oy0) / dt, (omega[2] - oz0) / dt
                speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2)
                travel = speed * dt
                _rest(body, plant, reference, speed, dt)
        else:
            body.on_ground = False
    else:
        body.on_ground = False

    body.acceleration_map[0], body.acceleration_map[1], body.acceleration_map[2] = ax, ay, az
    body.angular_acceleration_body[0] = bx
    body.angular_acceleration_body[1] = by
    body.angular_acceleration_body[2] = bz
    ease = dt - lag  # mean of old and new velocity in the air, the new one on the ground
    position[0] += lag * velocity[0] + ease * vx0
    position[1] += lag * velocity[1] + ease * vy0
    position[2] += lag * velocity[2] + ease * vz0
    attitude[0], attitude[1], attitude[2], attitude[3] = _turned(
        qx,
        qy,
        qz,
        qw,
        0.5 * (lag * omega[0] + ease * ox0),
        0.5 * (lag * omega[1] + ease * oy0),
        0.5 * (lag * omega[2] + ease * oz0),
    )
    body.contact_budget -= travel
    body.separation_budget -= travel
    return touch


@inline_kernel
def _turned(
    qx: float, qy: float, qz: float, qw: float, hx: float, hy: float, hz: float
) -> tuple[float, float, float, float]:
    """Attitude turned by the body-frame rotation vector 2 h: q exp(h), by its series in |h|.

    The series errs by |h|^6/5040 (1e-12 at 100 rad/s and 1 kHz); one Newton step keeps the
    quaternion of unit length.
    """
    s = hx * hx + hy * hy + hz * hz
    c = 1.0 - s * (0.5 - s * (1.0 / 24.0))
    f = 1.0 - s * (1.0 / 6.0 - s * (1.0 / 120.0))
    hx *= f
    hy *= f
    hz *= f
    x = qw * hx + qx * c + qy * hz - qz * hy
    y = qw * hy - qx * hz + qy * c + qz * hx
    z = qw * hz + qx * hy - qy * hx + qz * c
    w = qw * c - qx * hx - qy * hy - qz * hz
    n = 1.5 - 0.5 * (x * x + y * y + z * z + w * w)
    return x * n, y * n, z * n, w * n


@inline_kernel
def _rest(body: Any, plant: Any, reference: Array, speed: float, dt: float) -> None:
    """Put a body to sleep that has lain still, rotors stopped, for a while."""
    still = speed < _STILL_SPEED
    for k in range(3):
        still = still and abs(body.omega_body[k]) < _STILL_SPEED
    for r in range(plant.rotors):
        still = still and reference[r] == 0.0
    body.still_steps = body.still_steps + 1 if still else 0
    if body.still_steps * dt >= _STILL_S:
        body.asleep = True
        for k in range(3):
            body.velocity_map[k] = body.omega_body[k] = 0.0
            body.free_acceleration[k] = body.free_angular_acceleration[k] = 0.0
        for r in range(plant.rotors):
            body.rotor_speed[r] = 0.0
