"""Forces of the air: rotors after RotorS and PX4, quadratic drag of the body.

A rotor at speed w whose hub moves at v through the air, v_par along its axis and v_perp across:

    thrust          F = kF w^2 clamp(1 - |v_par| / 25, 0, 1)      along the axis
    in-plane drag   H = -w c_d v_perp                             at the hub
    reaction torque -s F kM                                       about the axis
    rolling moment  -w s c_r v_perp

with s = +1 for a rotor that turns counter-clockwise seen from above. Its speed follows the command
as a first-order lag, faster up than down, solved exactly. Source of form and constants: the motor
model plugins of RotorS (ETH Zurich) and PX4's Gazebo Classic simulation.

The body's drag along each of its axes is -1/2 rho C_d A |v| v_i, v relative to the wind (modelling
choice; the areas are the airframe's).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.vehicle.airframe import MAX_FEET, MAX_ROTORS, Airframe
from volery.vehicle.compiled import inner_kernel

Array = NDArray[np.float64]

AIR_DENSITY = 1.225
"""kg/m^3: International Standard Atmosphere at sea level."""
INFLOW_SPEED = 25.0
"""m/s along the axis at which a rotor's thrust is gone (RotorS, PX4)."""
_INVERSE_INFLOW = 1.0 / INFLOW_SPEED
MAX_CONTACTS = MAX_FEET + MAX_ROTORS + 2

PLANT = np.dtype(
    [
        ("inverse_mass", "f8"),
        ("inverse_inertia", "f8", 3),
        ("gyroscopic", "f8", 3),  # (Izz - Iyy) / Ixx and so on around
        ("drag", "f8", 3),
        ("rotors", "i8"),
        ("upright", "i8"),
        ("rotor_position", "f8", (MAX_ROTORS, 3)),
        ("rotor_axis", "f8", (MAX_ROTORS, 3)),
        ("spin", "f8", MAX_ROTORS),
        ("thrust_constant", "f8"),
        ("torque_constant", "f8"),
        ("rotor_drag", "f8"),
        ("rolling", "f8"),
        ("rise", "f8"),
        ("rise_half", "f8"),
        ("fall", "f8"),
        ("fall_half", "f8"),
        ("contacts", "i8"),
        ("contact_point", "f8", (MAX_CONTACTS, 3)),
        ("contact_radius", "f8"),
        ("friction", "f8"),
        ("restitution", "f8"),
        ("landing_limit", "f8"),
    ],
    align=True,
)
"""One airframe as kernels read it: SI, FLU, lag factors for one time step and half of it."""


def plant_of(airframe: Airframe, dt: float) -> NDArray[np.void]:
    """The (1,) `PLANT` row of an airframe stepped by `dt` s."""
    row = np.zeros(1, PLANT)
    body, rotors, ground = airframe.body, airframe.rotors, airframe.ground
    inertia = np.array(body.inertia_kg_m2)
    row["inverse_mass"] = 1.0 / body.mass_kg
    row["inverse_inertia"] = 1.0 / inertia
    row["gyroscopic"] = (np.roll(inertia, 1) - np.roll(inertia, -1)) / inertia
    row["drag"] = 0.5 * AIR_DENSITY * np.array(body.drag_area_m2)
    count = len(rotors.places)
    row["rotors"] = count
    row["upright"] = all(place.axis == (0.0, 0.0, 1.0) for place in rotors.places)
    row["rotor_position"][0, :count] = [place.position_m for place in rotors.places]
    row["rotor_axis"][0, :count] = [place.axis for place in rotors.places]
    row["spin"][0, :count] = [1.0 if p.direction == "ccw" else -1.0 for p in rotors.places]
    row["thrust_constant"] = rotors.thrust_n_s2
    row["torque_constant"] = rotors.torque_m
    row["rotor_drag"] = rotors.drag_n_s2_m
    row["rolling"] = rotors.rolling_n_s2
    row["rise"] = math.exp(-dt / rotors.rise_time_s)
    row["rise_half"] = math.exp(-0.5 * dt / rotors.rise_time_s)
    row["fall"] = math.exp(-dt / rotors.fall_time_s)
    row["fall_half"] = math.exp(-0.5 * dt / rotors.fall_time_s)
    points = contact_points(airframe)
    row["contacts"] = len(points)
    row["contact_point"][0, : len(points)] = points
    row["contact_radius"] = np.linalg.norm(points, axis=1).max()
    row["friction"] = ground.friction
    row["restitution"] = ground.restitution
    row["landing_limit"] = ground.landing_speed_limit_m_s
    return row


def contact_points(airframe: Airframe) -> Array:
    """Points (P, 3) of the body that the ground can touch: feet, rotor tips, roof; m, FLU."""
    points = [np.array(foot) for foot in airframe.ground.feet_m]
    for place in airframe.rotors.places:
        hub = np.array(place.position_m)
        arm = math.hypot(hub[0], hub[1])
        reach = 1.0 + airframe.rotors.radius_m / arm if arm > 1e-6 else 1.0
        points.append(hub * np.array([reach, reach, 1.0]))
    roof = max(airframe.body.size_m[2] / 2.0, *(p[2] for p in points))
    points.append(np.array([0.0, 0.0, roof]))
    return np.array(points)


@inner_kernel
def air_wrench(
    body: Any,
    plant: Any,
    command: Any,
    vx: float,
    vy: float,
    vz: float,
    ox: float,
    oy: float,
    oz: float,
) -> tuple[float, float, float, float, float, float]:
    """Force and torque of the air at mid-step, FLU; the rotors' speeds move on by a whole step.

    body: a record with `rotor_speed`. plant: a `PLANT`. command: a record with `rotor_reference`,
    rad/s. (vx, vy, vz) m/s: velocity of the centre of mass through the air, (ox, oy, oz) rad/s:
    body rates, both FLU and at mid-step.
    Returns (fx, fy, fz, tx, ty, tz) in N and N m.
    """
    if plant.upright:
        fx, fy, fz, tx, ty, tz = _upright_rotors(body, plant, command, vx, vy, vz, ox, oy, oz)
    else:
        fx, fy, fz, tx, ty, tz = _leaning_rotors(body, plant, command, vx, vy, vz, ox, oy, oz)
    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    fx -= plant.drag[0] * speed * vx
    fy -= plant.drag[1] * speed * vy
    fz -= plant.drag[2] * speed * vz
    return fx, fy, fz, tx, ty, tz


@inner_kernel
def _speed_at_mid_step(body: Any, plant: Any, command: Any, r: int) -> float:
    """Speed of rotor `r` half a step on, rad/s; its speed in `body` moves on by a whole step."""
    wanted = command.rotor_reference[r]
    lead = body.rotor_speed[r] - wanted
    rising = lead < 0.0
    body.rotor_speed[r] = wanted + lead * (plant.rise if rising else plant.fall)
    half: float = wanted + lead * (plant.rise_half if rising else plant.fall_half)
    return half


@inner_kernel
def _leaning_rotors(
    body: Any,
    plant: Any,
    command: Any,
    vx: float,
    vy: float,
    vz: float,
    ox: float,
    oy: float,
    oz: float,
) -> tuple[float, float, float, float, float, float]:
    """Force and torque of rotors with any axes."""
    lift, loss, roll, twist = (
        plant.thrust_constant,
        plant.rotor_drag,
        plant.rolling,
        plant.torque_constant,
    )
    fx = fy = fz = tx = ty = tz = 0.0
    for r in range(plant.rotors):
        w = _speed_at_mid_step(body, plant, command, r)
        px, py, pz = (
            plant.rotor_position[r, 0],
            plant.rotor_position[r, 1],
            plant.rotor_position[r, 2],
        )
        ax, ay, az = plant.rotor_axis[r, 0], plant.rotor_axis[r, 1], plant.rotor_axis[r, 2]
        hx = vx + oy * pz - oz * py
        hy = vy + oz * px - ox * pz
        hz = vz + ox * py - oy * px
        along = hx * ax + hy * ay + hz * az
        hx -= along * ax
        hy -= along * ay
        hz -= along * az
        thrust = lift * w * w * max(1.0 - abs(along) * _INVERSE_INFLOW, 0.0)
        gx = thrust * ax - loss * w * hx
        gy = thrust * ay - loss * w * hy
        gz = thrust * az - loss * w * hz
        reaction = plant.spin[r] * twist * thrust
        rolling = plant.spin[r] * roll * w
        fx += gx
        fy += gy
        fz += gz
        tx += py * gz - pz * gy - reaction * ax - rolling * hx
        ty += pz * gx - px * gz - reaction * ay - rolling * hy
        tz += px * gy - py * gx - reaction * az - rolling * hz
    return fx, fy, fz, tx, ty, tz


@inner_kernel
def _upright_rotors(
    body: Any,
    plant: Any,
    command: Any,
    vx: float,
    vy: float,
    vz: float,
    ox: float,
    oy: float,
    oz: float,
) -> tuple[float, float, float, float, float, float]:
    """`_leaning_rotors` where every axis is the body's z, at half its cost."""
    lift, loss, roll, twist = (
        plant.thrust_constant,
        plant.rotor_drag,
        plant.rolling,
        plant.torque_constant,
    )
    fx = fy = fz = tx = ty = tz = 0.0
    for r in range(plant.rotors):
        w = _speed_at_mid_step(body, plant, command, r)
        px, py, pz = (
            plant.rotor_position[r, 0],
            plant.rotor_position[r, 1],
            plant.rotor_position[r, 2],
        )
        hx = vx + oy * pz - oz * py
        hy = vy + oz * px - ox * pz
        along = vz + ox * py - oy * px
        thrust = lift * w * w * max(1.0 - abs(along) * _INVERSE_INFLOW, 0.0)
        gx = -loss * w * hx
        gy = -loss * w * hy
        rolling = plant.spin[r] * roll * w
        fx += gx
        fy += gy
        fz += thrust
        tx += py * thrust - pz * gy - rolling * hx
        ty += pz * gx - px * thrust - rolling * hy
        tz += px * gy - py * gx - plant.spin[r] * twist * thrust
    return fx, fy, fz, tx, ty, tz
