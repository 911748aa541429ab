"""One step of the plant: rotors, air, gravity, ground, and the rigid body's motion.

Velocity Verlet in its one-evaluation form: forces are evaluated once, at mid-step, from velocity,
rates and attitude extrapolated half a step and from the rotors' exact mid-step speeds; the velocity
advances the whole step with them, the position with the mean of old and new velocity, and the
attitude by the exponential of the mean rate. Second order in the step wherever commands and
contacts leave the motion smooth.
"""

from __future__ import annotations

import math
from typing import Any

from volery.core.arrays import Array
from volery.core.simd import LANES, lanes_at, put_lanes
from volery.vehicle.aerodynamics import air_wrench
from volery.vehicle.airframe import GRAVITY
from volery.vehicle.compiled import apart_kernel, inner_kernel
from volery.vehicle.contact import NO_TOUCH, classify_touch, resolve_contact
from volery.vehicle.rotation_math import matrix_of, nudged, three, turned
from volery.world.terrain import TerrainGrid, terrain_height

_GROUND_MARGIN = 0.05
"""Margin when the next terrain query is postponed, m."""
_STILL_SPEED = 0.03
"""Speed, m/s, and rate, rad/s, below which a body on the ground counts as still ..."""
_STILL_S = 0.25
"""... and the time in s after which it sleeps."""
_WRECK_DAMPING_S = 0.15
"""Time constant with which a crashed body on the ground loses its motion, s (modelling choice)."""


@inner_kernel
def accelerate(body: Any, plant: Any, command: Any, dt: float) -> None:
    """Advances velocity and rates of a `BODY` to the end of the step: rotors, air and gravity.

    command: a record with `rotor_reference`, rad/s, constant over the step.
    """
    half = 0.5 * dt
    vx, vy, vz = three(body.velocity_map)
    ox, oy, oz = three(body.omega_body)
    ax, ay, az = three(body.acceleration_map)
    bx, by, bz = three(body.angular_acceleration_body)
    if body.on_ground:  # without contact forces
        ax, ay, az = three(body.free_acceleration)
        bx, by, bz = three(body.free_angular_acceleration)
    # mid-step, extrapolated
    mx = ox + half * bx
    my = oy + half * by
    mz = oz + half * bz
    ax = vx + half * ax - body.air_velocity_map[0]
    ay = vy + half * ay - body.air_velocity_map[1]
    az = vz + half * az - body.air_velocity_map[2]
    quarter = 0.5 * half
    x, y, z, w = nudged(
        body.attitude[0],
        body.attitude[1],
        body.attitude[2],
        body.attitude[3],
        quarter * mx,
        quarter * my,
        quarter * mz,
    )
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix_of(x, y, z, w)
    fx, fy, fz, tx, ty, tz = air_wrench(
        body,
        plant,
        command,
        r00 * ax + r10 * ay + r20 * az,
        r01 * ax + r11 * ay + r21 * az,
        r02 * ax + r12 * ay + r22 * az,
        mx,
        my,
        mz,
    )
    light = plant.inverse_mass
    ax = (r00 * fx + r01 * fy + r02 * fz) * light
    ay = (r10 * fx + r11 * fy + r12 * fz) * light
    az = (r20 * fx + r21 * fy + r22 * fz) * light - GRAVITY
    bx = tx * plant.inverse_inertia[0] - plant.gyroscopic[0] * my * mz
    by = ty * plant.inverse_inertia[1] - plant.gyroscopic[1] * mz * mx
    bz = tz * plant.inverse_inertia[2] - plant.gyroscopic[2] * mx * my
    _store(body.acceleration_map, ax, ay, az)
    _store(body.angular_acceleration_body, bx, by, bz)
    _store(body.velocity_map, vx + dt * ax, vy + dt * ay, vz + dt * az)
    _store(body.omega_body, ox + dt * bx, oy + dt * by, oz + dt * bz)
    body.on_ground = False


@inner_kernel
def turn_rotors(body: Any, plant: Any, seconds: float) -> None:
    """Advances the rotor angles by a guidance tick, from its start to its end.

    Cameras draw the blades by them; the motion does not depend on them, so the speed at the start
    of the tick suffices.
    """
    for first in range(0, plant.rotors, LANES):
        angle = lanes_at(body.rotor_angle, first) + lanes_at(body.rotor_speed, first) * seconds
        put_lanes(body.rotor_angle, first, angle)


@inner_kernel
def near_ground(body: Any, dt: float) -> bool:
    """Returns whether the ground must be queried in this step."""
    vx, vy, vz = three(body.velocity_map)
    travel = (
        abs(vx) + abs(vy) + abs(vz)
    ) * dt  # an upper bound of the distance flown, without a root
    return bool(body.ground_budget < _GROUND_MARGIN + travel)


@apart_kernel
def meet_ground(
    body: Any,
    plant: Any,
    command: Any,
    grid: TerrainGrid,
    steepest: float,
    bounce: bool,
    scratch: Array,
    step: int,
    dt: float,
) -> int:
    """Stops the body at the ground; returns `NO_TOUCH`, `TOUCH_DOWN` or `IMPACT`.

    steepest: cosine of the terrain's steepest slope. step: number of the step that ends here.
    """
    height = body.position_map[2] - terrain_height(grid, body.position_map[0], body.position_map[1])
    body.ground_budget = height * steepest - plant.contact_radius
    if not near_ground(body, dt):
        return NO_TOUCH
    vx, vy, vz = three(body.velocity_map)
    ox, oy, oz = three(body.omega_body)
    speed = _speed(body)
    approach = resolve_contact(body, plant, grid, bounce, scratch, dt)
    if approach < 0.0:
        return NO_TOUCH
    body.on_ground = True
    keep = 1.0 - dt / _WRECK_DAMPING_S if body.crashed else 1.0
    for k in range(3):
        body.velocity_map[k] *= keep
        body.omega_body[k] *= keep
        body.free_acceleration[k] = body.acceleration_map[k]
        body.free_angular_acceleration[k] = body.angular_acceleration_body[k]
    body.acceleration_map[0] += (body.velocity_map[0] - vx) / dt
    body.acceleration_map[1] += (body.velocity_map[1] - vy) / dt
    body.acceleration_map[2] += (body.velocity_map[2] - vz) / dt
    body.angular_acceleration_body[0] += (body.omega_body[0] - ox) / dt
    body.angular_acceleration_body[1] += (body.omega_body[1] - oy) / dt
    body.angular_acceleration_body[2] += (body.omega_body[2] - oz) / dt
    _rest(body, plant, command, dt)
    return classify_touch(body, plant, approach, speed, step, dt, bounce)


@inner_kernel
def carry(body: Any, dt: float) -> None:
    """Advances position and attitude to the end of the step; reduces budgets by the distance.

    They advance by the mean of the old and the new velocity; on the ground by the new one, which
    the contact allows.
    """
    half = 0.5 * dt
    back = 0.0 if body.on_ground else half
    vx, vy, vz = three(body.velocity_map)
    travel = dt * math.sqrt(vx * vx + vy * vy + vz * vz)
    x, y, z, w = turned(
        body.attitude[0],
        body.attitude[1],
        body.attitude[2],
        body.attitude[3],
        half * (body.omega_body[0] - back * body.angular_acceleration_body[0]),
        half * (body.omega_body[1] - back * body.angular_acceleration_body[1]),
        half * (body.omega_body[2] - back * body.angular_acceleration_body[2]),
    )
    vx -= back * body.acceleration_map[0]
    vy -= back * body.acceleration_map[1]
    vz -= back * body.acceleration_map[2]
    body.position_map[0] += dt * vx
    body.position_map[1] += dt * vy
    body.position_map[2] += dt * vz
    body.attitude[0], body.attitude[1], body.attitude[2], body.attitude[3] = x, y, z, w
    body.ground_budget -= travel
    body.contact_budget -= travel
    body.separation_budget -= travel
    body.downwash_budget -= travel


@inner_kernel
def _speed(body: Any) -> float:
    vx, vy, vz = three(body.velocity_map)
    return math.sqrt(vx * vx + vy * vy + vz * vz)


@inner_kernel
def _store(vector: Array, x: float, y: float, z: float) -> None:
    vector[0] = x
    vector[1] = y
    vector[2] = z


@inner_kernel
def _rest(body: Any, plant: Any, command: Any, dt: float) -> None:
    """Puts a body to sleep that has rested, rotors stopped, for a while."""
    still = True
    for k in range(3):
        still = still and abs(body.velocity_map[k]) < _STILL_SPEED
        still = still and abs(body.omega_body[k]) < _STILL_SPEED
    for r in range(plant.rotors):
        still = still and command.rotor_reference[r] == 0.0
    body.still_steps = body.still_steps + 1 if still else 0
    if body.still_steps * dt >= _STILL_S:
        body.asleep = True
        for k in range(3):
            body.velocity_map[k] = body.omega_body[k] = 0.0
            body.free_acceleration[k] = body.free_angular_acceleration[k] = 0.0
        for r in range(plant.rotors):
            body.rotor_speed[r] = 0.0
