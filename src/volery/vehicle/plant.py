"""Parameters of one airframe's plant, for kernels: masses, rotors, battery, contact points."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.scenario.schema import RotorWear
from volery.vehicle.airframe import MAX_FEET, MAX_ROTORS, Airframe
from volery.vehicle.battery import BATTERY, battery_row

AIR_DENSITY = 1.225
"""Density of air, kg/m^3: International Standard Atmosphere at sea level."""
MAX_CONTACTS = MAX_FEET + MAX_ROTORS + 2
GROUND_FADE = (6.0, 10.0)
"""Heights in rotor radii between which the ground effect fades out (modelling choice: at the lower
one the effect is below 2 percent of the thrust)."""

PLANT = np.dtype(
    [
        ("inverse_mass", "f8"),
        ("inverse_inertia", "f8", 3),
        ("gyroscopic", "f8", 3),  # (Izz - Iyy) / Ixx and so on around
        ("drag", "f8", 3),
        ("rotors", "i8"),
        ("upright", "i8"),  # all axes along z, all hubs at one height
        ("rotor_x", "f8", MAX_ROTORS),
        ("rotor_y", "f8", MAX_ROTORS),
        ("rotor_z", "f8", MAX_ROTORS),
        ("rotor_axis", "f8", (MAX_ROTORS, 3)),
        ("spin", "f8", MAX_ROTORS),  # 1 counter-clockwise seen from above, -1 clockwise
        ("reaction", "f8", MAX_ROTORS),  # spin times torque over thrust, m
        ("rise", "f8", MAX_ROTORS),
        ("rise_half", "f8", MAX_ROTORS),
        ("fall", "f8", MAX_ROTORS),
        ("fall_half", "f8", MAX_ROTORS),
        ("rotor_power", "f8", MAX_ROTORS),  # W s^3: drawn from the battery, over speed cubed
        ("thrust_constant", "f8"),
        ("rotor_drag", "f8"),
        ("rolling", "f8"),
        ("max_speed", "f8"),
        ("rotor_radius", "f8"),
        ("jet_radius", "f8"),  # of the disc with the area of all rotors
        ("adjacent_square", "f8"),  # mean d^2 of neighbouring rotors of four; 0: not a quadrotor
        ("opposite_square", "f8"),  # mean b^2 of opposite ones
        ("max_ground_effect_height", "f8"),
        ("battery", BATTERY),
        ("contacts", "i8"),
        ("contact_point", "f8", (MAX_CONTACTS, 3)),
        ("contact_radius", "f8"),
        ("friction", "f8"),
        ("restitution", "f8"),
        ("landing_limit", "f8"),
    ],
    align=True,
)
"""Parameters of one airframe for kernels: SI, FLU, lag factors for a time step and half of it."""


def plant_of(
    airframe: Airframe, dt: float, battery_period: float, wear: Sequence[RotorWear] = ()
) -> NDArray[np.void]:
    """Returns the (1,) `PLANT` row of an airframe stepped by `dt` s.

    battery_period: time between battery updates, s. wear: one per rotor, or none. The thrust that
    wear leaves is a state (`BODY`'s rotor_health), outside this row.
    """
    row = np.zeros(1, PLANT)
    body, ground = airframe.body, airframe.ground
    inertia = np.array(body.inertia_kg_m2)
    row["inverse_mass"] = 1.0 / body.mass_kg
    row["inverse_inertia"] = 1.0 / inertia
    row["gyroscopic"] = (np.roll(inertia, 1) - np.roll(inertia, -1)) / inertia
    row["drag"] = 0.5 * AIR_DENSITY * np.array(body.drag_area_m2)
    _fill_rotors(row[0], airframe, dt, wear)
    _fill_neighbours(row[0], airframe)
    row["battery"] = battery_row(airframe.battery, airframe.rotors.max_speed_rad_s, battery_period)[
        0
    ]
    points = contact_points(airframe)
    row["contacts"] = len(points)
    row["contact_point"][0, : len(points)] = points
    row["contact_radius"] = np.linalg.norm(points, axis=1).max()
    row["friction"] = ground.friction
    row["restitution"] = ground.restitution
    row["landing_limit"] = ground.landing_speed_limit_m_s
    return row


def _fill_rotors(row: np.void, airframe: Airframe, dt: float, wear: Sequence[RotorWear]) -> None:
    rotors = airframe.rotors
    count = len(rotors.places)
    position = np.array([rotor.position_m for rotor in rotors.places])
    axis = np.array([rotor.axis for rotor in rotors.places])
    spin = np.array([1.0 if p.direction == "ccw" else -1.0 for p in rotors.places])
    torque = np.array([w.torque for w in wear] or [1.0] * count)
    lag = np.array([w.lag for w in wear] or [1.0] * count)
    level = np.ptp(position[:, 2]) == 0.0
    row["rotors"] = count
    row["upright"] = level and bool((axis == (0.0, 0.0, 1.0)).all())
    for k, name in enumerate(("rotor_x", "rotor_y", "rotor_z")):
        row[name][:count] = position[:, k]
    row["rotor_axis"][:count] = axis
    row["spin"][:count] = spin
    row["reaction"][:count] = spin * rotors.torque_m * torque
    for name, time in (("rise", rotors.rise_time_s), ("fall", rotors.fall_time_s)):
        row[name][:count] = np.exp(-dt / (lag * time))
        row[f"{name}_half"][:count] = np.exp(-0.5 * dt / (lag * time))
    if airframe.battery is not None:
        power_torque = airframe.battery.power_torque_m or rotors.torque_m
        power = rotors.thrust_n_s2 * power_torque / airframe.battery.efficiency
        row["rotor_power"][:count] = power * torque
    row["thrust_constant"] = rotors.thrust_n_s2
    row["rotor_drag"] = rotors.drag_n_s2_m
    row["rolling"] = rotors.rolling_n_s2
    row["max_speed"] = rotors.max_speed_rad_s
    row["rotor_radius"] = rotors.radius_m
    row["jet_radius"] = math.sqrt(count) * rotors.radius_m


def _fill_neighbours(row: np.void, airframe: Airframe) -> None:
    """Sets the range of the ground effect, and the spacings of four rotors in one plane."""
    rotors = airframe.rotors
    row["max_ground_effect_height"] = GROUND_FADE[1] * rotors.radius_m
    if not (row["upright"] and row["rotors"] == 4):
        return
    position = np.array([p.position_m[:2] for p in rotors.places])
    position = position[np.argsort(np.arctan2(position[:, 1], position[:, 0]))]
    row["adjacent_square"] = ((position - np.roll(position, 1, axis=0)) ** 2).sum(axis=1).mean()
    row["opposite_square"] = ((position - np.roll(position, 2, axis=0)) ** 2).sum(axis=1).mean()


def contact_points(airframe: Airframe) -> Array:
    """Returns contact points (P, 3) of the body: feet, rotor tips, roof; m, FLU."""
    points = [np.array(foot) for foot in airframe.ground.feet_m]
    for rotor in airframe.rotors.places:
        hub = np.array(rotor.position_m)
        arm = math.hypot(hub[0], hub[1])
        scale = 1.0 + airframe.rotors.radius_m / arm if arm > 1e-6 else 1.0
        points.append(hub * np.array([scale, scale, 1.0]))
    roof = max(airframe.body.size_m[2] / 2.0, *(p[2] for p in points))
    points.append(np.array([0.0, 0.0, roof]))
    return np.array(points)
