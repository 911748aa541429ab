"""Flocking in confined spaces, after G. Vásárhelyi et al., Science Robotics 3, eaat3536, 2018.

UAVs repel each other, align their velocities, and avoid walls as if these moved inwards. Whatever
must be braked follows a curve that a vehicle with a limited acceleration can fly.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from volery.autonomy.swarm.behaviour import Flock, Surroundings
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel


class VasarhelyiSettings(NamedTuple):
    """Parameters of the model; names of the paper in brackets."""

    max_speed_m_s: float = 5.0
    """(v_max)"""
    repulsion_m: float = 5.0
    """Distance below which two UAVs repel each other (r0_rep)."""
    repulsion_gain: float = 0.8
    """Velocity per distance, 1/s (p_rep)."""
    friction_m: float = 8.0
    """Distance at which the braking curve of alignment stops (r0_frict)."""
    friction_gain: float = 0.3
    """Part of a difference of velocities that is taken away (C_frict)."""
    friction_speed_m_s: float = 0.6
    """Difference that is always allowed (v_frict)."""
    friction_slope: float = 1.0
    """Slope of the braking curve near its end, 1/s (p_frict)."""
    friction_acceleration_m_s2: float = 2.0
    """Deceleration of the braking curve (a_frict)."""
    wall_speed_m_s: float = 10.0
    """Speed at which walls seem to move inwards (v_shill)."""
    post_speed_m_s: float = 4.0
    """The same of cylinders."""
    wall_m: float = 1.5
    """Distance from both at which their braking curve stops (r0_shill)."""
    wall_slope: float = 1.5
    """(p_shill)"""
    wall_acceleration_m_s2: float = 2.5
    """(a_shill)"""


class Vasarhelyi:
    """Flocks; implements `SwarmBehaviour`."""

    def __init__(self, settings: VasarhelyiSettings | None = None) -> None:
        self.settings = chosen = settings or VasarhelyiSettings()
        braking_m = (chosen.max_speed_m_s * 2.0) ** 2 / (2.0 * chosen.friction_acceleration_m_s2)
        self.radius_m = max(chosen.repulsion_m, chosen.friction_m + braking_m)

    def velocities(self, flock: Flock, preferred: Array, around: Surroundings) -> Array:
        """Returns commanded velocities (N, 2) m/s."""
        wanted = np.array(preferred, float)
        _add_terms(*flock, *around, self.settings, wanted)
        return wanted


@kernel
def _add_terms(
    position: Any,
    velocity: Any,
    first: Any,
    neighbour: Any,
    arena: Any,
    cylinders: Any,
    echoes: Any,
    settings: VasarhelyiSettings,
    wanted: Any,
) -> None:
    """Adds what neighbours and walls change to the wanted velocities (N, 2)."""
    for i in range(len(position)):
        for j in neighbour[first[i] : first[i + 1]]:
            _keep_apart(position, velocity, i, j, settings, wanted)
        for side in range(4):
            axis, is_end = side % 2, side >= 2
            inwards = -1.0 if is_end else 1.0
            away = inwards * (position[i, axis] - arena[side])
            x, y = (inwards, 0.0) if axis == 0 else (0.0, inwards)
            _keep_off(velocity, i, away, settings.wall_speed_m_s, x, y, settings, wanted)
        for k in range(len(cylinders)):
            x, y = position[i, 0] - cylinders[k, 0], position[i, 1] - cylinders[k, 1]
            _keep_off_post(velocity, i, x, y, cylinders[k, 2], settings, wanted)
        for k in range(echoes.shape[1]):
            x, y = -echoes[i, k, 0], -echoes[i, k, 1]
            if not math.isnan(x):
                _keep_off_post(velocity, i, x, y, 0.0, settings, wanted)
        speed = math.hypot(wanted[i, 0], wanted[i, 1])
        if speed > settings.max_speed_m_s:
            wanted[i, 0] *= settings.max_speed_m_s / speed
            wanted[i, 1] *= settings.max_speed_m_s / speed


@inner_kernel
def _keep_apart(
    position: Any, velocity: Any, i: int, j: int, settings: VasarhelyiSettings, wanted: Any
) -> None:
    """Repels UAV i from UAV j, and aligns it."""
    x, y = position[i, 0] - position[j, 0], position[i, 1] - position[j, 1]
    distance = math.hypot(x, y)
    if 0.0 < distance < settings.repulsion_m:
        push = settings.repulsion_gain * (settings.repulsion_m - distance) / distance
        wanted[i, 0] += push * x
        wanted[i, 1] += push * y
    x, y = velocity[j, 0] - velocity[i, 0], velocity[j, 1] - velocity[i, 1]
    difference = math.hypot(x, y)
    allowed = max(
        settings.friction_speed_m_s,
        _braking_speed(
            distance - settings.friction_m,
            settings.friction_slope,
            settings.friction_acceleration_m_s2,
        ),
    )
    if difference > allowed:
        pull = settings.friction_gain * (difference - allowed) / difference
        wanted[i, 0] += pull * x
        wanted[i, 1] += pull * y


@inner_kernel
def _keep_off(
    velocity: Any,
    i: int,
    away: float,
    speed: float,
    x: float,
    y: float,
    settings: VasarhelyiSettings,
    wanted: Any,
) -> None:
    """Aligns UAV i with a wall at a distance `away` that moves with a speed along (x, y)."""
    allowed = _braking_speed(
        away - settings.wall_m, settings.wall_slope, settings.wall_acceleration_m_s2
    )
    x, y = speed * x - velocity[i, 0], speed * y - velocity[i, 1]
    difference = math.hypot(x, y)
    if difference > allowed:
        wanted[i, 0] += (difference - allowed) / difference * x
        wanted[i, 1] += (difference - allowed) / difference * y


@inner_kernel
def _keep_off_post(
    velocity: Any,
    i: int,
    x: float,
    y: float,
    radius: float,
    settings: VasarhelyiSettings,
    wanted: Any,
) -> None:
    """Aligns UAV i, which is at (x, y) from the middle of a post, with the post's side."""
    distance = max(math.hypot(x, y), 1e-6)
    away, speed = distance - radius, settings.post_speed_m_s
    _keep_off(velocity, i, away, speed, x / distance, y / distance, settings, wanted)


@inner_kernel
def _braking_speed(distance: float, slope: float, acceleration: float) -> float:
    """Returns the speed from which a vehicle stops within a distance (the paper's D)."""
    if distance <= 0.0:
        return 0.0
    if distance * slope < acceleration / slope:
        return distance * slope
    return math.sqrt(2.0 * acceleration * distance - (acceleration / slope) ** 2)
