"""The kinematic plant: an external velocity or pose moves the body exactly and at once.

Like the vehicles of the ROS and Unity3D platform of 2025: no forces, level attitude, a Twist is
integrated along its arc. Optionally velocities follow with a first-order lag and within the
airframe's limits. The ground stops the UAV; collisions do not crash it by themselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.vehicle.airframe import Airframe, hover_thrusts
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.contact import FRESH_S, IMPACT, NO_TOUCH, TOUCH_DOWN
from volery.vehicle.rotation_math import four, three
from volery.world.terrain import TerrainGrid, terrain_height

_GROUND_MARGIN = 0.05
"""Margin when the next terrain query is postponed, m."""


@dataclass(frozen=True)
class Kinematic:
    """Response of a kinematic UAV to velocity commands."""

    time_constant_s: float = 0.0
    """First-order lag of velocity and yaw rate; 0: at once."""
    limited: bool = False
    """Whether the airframe's limits of speed, climb, descent and yaw rate apply."""


KINEMATIC = np.dtype(
    [
        ("left", "f8"),  # fraction of a velocity error left after a step
        ("offset", "f8"),  # m, of the origin above the ground at rest
        ("hover_speed", "f8"),  # rad/s, shown as its rotors' speed
        ("limited", "i8"),
    ],
    align=True,
)
"""Parameters of a kinematic model for kernels, for one time step."""


def kinematic_row(model: Kinematic, airframe: Airframe, dt: float) -> NDArray[np.void]:
    """Returns the (1,) `KINEMATIC` row of a model, stepped by `dt` s."""
    row = np.zeros(1, KINEMATIC)
    lag = model.time_constant_s
    row["left"] = math.exp(-dt / lag) if lag > 0.0 else 0.0
    row["offset"] = airframe.ground_offset
    mean = float(hover_thrusts(airframe).mean())
    row["hover_speed"] = math.sqrt(mean / airframe.rotors.thrust_n_s2)
    row["limited"] = model.limited
    return row


@inner_kernel
def drive(body: Any, ux: float, uy: float, uz: float, rate: float, dt: float) -> None:
    """Moves with (ux, uy, uz) m/s, forward, left and up, along an arc of `rate` rad/s."""
    c, s = _heading(body)
    h = 0.5 * rate * dt
    ch, sh = _cosine_and_sine(h)
    chord = dt * (sh / h if abs(h) > 1e-5 else 1.0 - h * h / 6.0)
    cm, sm = c * ch - s * sh, s * ch + c * sh  # the mean heading of the step
    px = body.position_map[0] + chord * (cm * ux - sm * uy)
    py = body.position_map[1] + chord * (sm * ux + cm * uy)
    pz = body.position_map[2] + dt * uz
    c, s = cm * ch - sm * sh, sm * ch + cm * sh
    put(body, px, py, pz, c * ux - s * uy, s * ux + c * uy, uz, dt)
    face(body, c, s, rate, dt)


@inner_kernel
def glide(body: Any, ax: float, ay: float, az: float, dt: float) -> None:
    """Advances from the present velocity with a constant acceleration, m/s^2, map."""
    half = 0.5 * dt
    px, py, pz = three(body.position_map)
    vx, vy, vz = three(body.velocity_map)
    px += dt * (vx + half * ax)
    py += dt * (vy + half * ay)
    pz += dt * (vz + half * az)
    put(body, px, py, pz, vx + dt * ax, vy + dt * ay, vz + dt * az, dt)


@inner_kernel
def put(
    body: Any, px: float, py: float, pz: float, vx: float, vy: float, vz: float, dt: float
) -> None:
    """Sets position and velocity at the step's end, map; reduces budgets by the distance."""
    dx, dy, dz = (
        px - body.position_map[0],
        py - body.position_map[1],
        pz - body.position_map[2],
    )
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    body.ground_budget -= distance
    body.contact_budget -= distance
    body.separation_budget -= distance
    back = 1.0 / dt
    body.acceleration_map[0] = back * (vx - body.velocity_map[0])
    body.acceleration_map[1] = back * (vy - body.velocity_map[1])
    body.acceleration_map[2] = back * (vz - body.velocity_map[2])
    body.position_map[0], body.position_map[1], body.position_map[2] = px, py, pz
    body.velocity_map[0], body.velocity_map[1], body.velocity_map[2] = vx, vy, vz
    body.on_ground = False


@inner_kernel
def turn_by(body: Any, rate: float, dt: float) -> None:
    """Levels the body and turns it at `rate` rad/s for a step."""
    x, y, z, w = four(body.attitude)
    if x == 0.0 and y == 0.0:
        ch, sh = _cosine_and_sine(0.5 * rate * dt)
        z, w = z * ch + w * sh, w * ch - z * sh
        n = 1.5 - 0.5 * (z * z + w * w)  # a Newton step to unit length
        body.attitude[2], body.attitude[3] = n * z, n * w
        _spin(body, rate, dt)
        return
    c, s = _heading(body)
    ct, st = _cosine_and_sine(rate * dt)
    face(body, c * ct - s * st, s * ct + c * st, rate, dt)


@inner_kernel
def face(body: Any, c: float, s: float, rate: float, dt: float) -> None:
    """Sets a level attitude with heading cosine `c` and sine `s`, turning at `rate` rad/s."""
    n = 1.0 / math.sqrt(c * c + s * s)
    c *= n
    s *= n
    if c >= 0.0:
        w = math.sqrt(0.5 * (1.0 + c))
        z = 0.5 * s / w
    else:
        z = math.copysign(math.sqrt(0.5 * (1.0 - c)), s)
        w = 0.5 * s / z
    body.attitude[0] = body.attitude[1] = 0.0
    body.attitude[2], body.attitude[3] = z, w
    _spin(body, rate, dt)


@inner_kernel
def _spin(body: Any, rate: float, dt: float) -> None:
    """Sets the body rates of a level vehicle."""
    back = 1.0 / dt
    body.angular_acceleration_body[0] = -back * body.omega_body[0]
    body.angular_acceleration_body[1] = -back * body.omega_body[1]
    body.angular_acceleration_body[2] = back * (rate - body.omega_body[2])
    body.omega_body[0] = body.omega_body[1] = 0.0
    body.omega_body[2] = rate


@inner_kernel
def _cosine_and_sine(angle: float) -> tuple[float, float]:
    """Returns cosine and sine; for small angles by a series with an error of 1e-17."""
    if abs(angle) > 0.02:
        return math.cos(angle), math.sin(angle)
    q = angle * angle
    cosine = 1.0 - q * (0.5 - q * (1.0 / 24.0 - q * (1.0 / 720.0)))
    return cosine, angle * (1.0 - q * (1.0 / 6.0 - q * (1.0 / 120.0 - q * (1.0 / 5040.0))))


@inner_kernel
def stop_at_ground(
    body: Any, plant: Any, model: Any, grid: TerrainGrid, steepest: float, step: int, dt: float
) -> int:
    """Keeps the feet above the ground; returns `NO_TOUCH`, `TOUCH_DOWN` or `IMPACT`.

    Continued pressure is the same contact. steepest: cosine of the terrain's steepest slope. step:
    number of the step that ends here.
    """
    if body.ground_budget > _GROUND_MARGIN:
        return NO_TOUCH
    ground = terrain_height(grid, body.position_map[0], body.position_map[1])
    gap = body.position_map[2] - ground - model.offset
    body.ground_budget = gap * steepest
    if gap > 0.0:
        return NO_TOUCH
    vx, vy, vz = three(body.velocity_map)
    body.position_map[2] = ground + model.offset
    body.velocity_map[2] = max(vz, 0.0)
    body.acceleration_map[2] += (body.velocity_map[2] - vz) / dt
    body.on_ground = True
    fresh = (step - body.last_contact_step) * dt > FRESH_S
    body.last_contact_step = step
    if body.crashed or not fresh:
        return NO_TOUCH
    body.touch_speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    return IMPACT if -vz > plant.landing_limit else TOUCH_DOWN


@inner_kernel
def _heading(body: Any) -> tuple[float, float]:
    x, y, z, w = four(body.attitude)
    c, s = 1.0 - 2.0 * (y * y + z * z), 2.0 * (w * z + x * y)
    n = math.sqrt(c * c + s * s)
    if n < 1e-6:
        return 1.0, 0.0
    return c / n, s / n
