"""Ground effect: rotors near the ground produce more thrust at the same speed.

    T / T_free = 1 / (1 - e)      e = S(z) / (1 + (V / v_i)^2)

    one rotor  S = (R / 4z)^2
    four       S = (R / 4z)^2 + R^2 z / (d^2 + 4z^2)^1.5 + (R^2 / 2) z / (2d^2 + 4z^2)^1.5
                   + 2 R^2 z K_b / (b^2 + 4z^2)^1.5

z is the hub's height over the terrain, V the speed of the air across the rotor, v_i its induced
speed in hover. One rotor: I. Cheeseman, W. Bennett, "The effect of the ground on a helicopter
rotor in forward flight", ARC R&M 3021, 1955. Four rotors in a plane: P. Sanchez-Cuevas, G. Heredia,
A. Ollero, "Characterization of the aerodynamic ground effect and its influence in multirotor
control", 2017, with d between neighbours, b between opposite rotors and the fountain of air under
the body K_b = 2; other numbers of rotors use the first form.

The effect fades out between `GROUND_FADE` radii (a cubic, so that forces stay smooth), and
heights below half a radius count as that (the first form has a pole at a quarter): modelling
choices.
"""

from __future__ import annotations

import math
from typing import Any

from volery.vehicle.compiled import apart_kernel, inner_kernel
from volery.vehicle.plant import AIR_DENSITY, GROUND_FADE
from volery.vehicle.rotation_math import matrix_of
from volery.world.terrain import TerrainGrid, terrain_height

BODY_LIFT = 2.0
"""K_b (Sanchez-Cuevas et al. 2017)."""
_MIN_HEIGHT = 0.5
"""Minimum height in rotor radii."""
_FADE_FROM, _FADE_TO = GROUND_FADE


@inner_kernel
def feels_ground(body: Any, plant: Any) -> bool:
    """Returns whether the ground may be near enough for its effect in this step."""
    return bool(body.ground_budget < plant.max_ground_effect_height)


@apart_kernel
def feel_ground(body: Any, plant: Any, grid: TerrainGrid, steepest: float, dt: float) -> None:
    """Updates `ground_budget`, and each rotor's `rotor_lift` at mid-step.

    A pure function of pose, velocity and rotor speeds; out of range the thrust is the free one.
    """
    x, y, z = body.position_map[0], body.position_map[1], body.position_map[2]
    body.ground_budget = (z - terrain_height(grid, x, y)) * steepest - plant.contact_radius
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix_of(
        body.attitude[0], body.attitude[1], body.attitude[2], body.attitude[3]
    )
    half = 0.5 * dt
    x += half * body.velocity_map[0]
    y += half * body.velocity_map[1]
    z += half * body.velocity_map[2]
    ax = body.velocity_map[0] - body.air_velocity_map[0]
    ay = body.velocity_map[1] - body.air_velocity_map[1]
    across = ax * ax + ay * ay
    area = math.pi * plant.rotor_radius * plant.rotor_radius
    altered = False
    for r in range(plant.rotors):
        px, py, pz = plant.rotor_x[r], plant.rotor_y[r], plant.rotor_z[r]
        hub_x = x + r00 * px + r01 * py + r02 * pz
        hub_y = y + r10 * px + r11 * py + r12 * pz
        height = z + r20 * px + r21 * py + r22 * pz - terrain_height(grid, hub_x, hub_y)
        lift = plant.thrust_constant * body.rotor_health[r]
        w = body.rotor_speed[r]
        induced = lift * w * w / (2.0 * AIR_DENSITY * area)  # v_i^2
        fraction = induced / (
            induced + across + 1e-12
        )  # 1 / (1 + (V / v_i)^2), 0 for a rotor at rest
        lift /= 1.0 - fraction * ground_fraction(plant, height)
        body.rotor_lift[r] = lift
        altered = altered or lift != plant.thrust_constant
    body.altered = altered


@inner_kernel
def ground_fraction(plant: Any, height: float) -> float:
    """Returns S of a rotor with its hub at `height` m above the ground, in hover, faded out."""
    radius = plant.rotor_radius
    if height >= _FADE_TO * radius:
        return 0.0
    z = max(height, _MIN_HEIGHT * radius)
    square = radius * radius
    far = 4.0 * z * z
    fraction = square / (4.0 * far)
    d = plant.adjacent_square
    if d > 0.0:
        fraction += square * z * _inverse_cube(d + far)
        fraction += 0.5 * square * z * _inverse_cube(2.0 * d + far)
        fraction += 2.0 * BODY_LIFT * square * z * _inverse_cube(plant.opposite_square + far)
    up = (z / radius - _FADE_FROM) * (1.0 / (_FADE_TO - _FADE_FROM))
    if up > 0.0:
        fraction *= 1.0 - up * up * (3.0 - 2.0 * up)
    faded: float = fraction
    return faded


@inner_kernel
def _inverse_cube(square: float) -> float:
    return 1.0 / (square * math.sqrt(square))
