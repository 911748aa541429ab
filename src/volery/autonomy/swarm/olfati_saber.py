"""Flocking as a lattice, after R. Olfati-Saber, IEEE Transactions on Automatic Control 51, 2006.

UAVs keep a distance from their neighbours like atoms in a lattice, match their velocities, and
avoid the nearest points of obstacles like UAVs that stand there or slide along. Names of the paper
are in brackets.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from volery.autonomy.swarm.behaviour import Flock, Surroundings
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel

_EPSILON = 0.1
"""Of the smooth norm."""
_FLAT_UAVS, _FLAT_OBSTACLES = 0.2, 0.9
"""Part of the range in which neighbours and obstacles count fully (h)."""


class OlfatiSaberSettings(NamedTuple):
    """Parameters of the model."""

    distance_m: float = 5.0
    """Distance of neighbours in the lattice (d)."""
    range_m: float = 6.5
    """Distance beyond which UAVs do not see each other (r)."""
    attraction: float = 1.0
    repulsion: float = 5.0
    """Limits of the action between neighbours, m/s^2 (a, b)."""
    lattice_gain: float = 1.0
    """(c1 of UAVs)"""
    matching_gain: float = 0.6
    """Of neighbours' velocities, 1/s (c2 of UAVs)."""
    goal_gain: float = 0.8
    """Of the preferred velocity, 1/s (c2 of the goal)."""
    obstacle_m: float = 4.0
    """Distance kept from obstacles (d of obstacles)."""
    obstacle_gain: float = 4.0
    """(c1 of obstacles)"""
    sliding_gain: float = 1.5
    """Of the velocity along an obstacle, 1/s (c2 of obstacles)."""
    response_s: float = 0.5
    """Commanded velocities are those that the accelerations reach after this time."""
    max_speed_m_s: float = 5.0


class OlfatiSaber:
    """Flocks as a lattice; implements `SwarmBehaviour`."""

    def __init__(self, settings: OlfatiSaberSettings | None = None) -> None:
        self.settings = settings or OlfatiSaberSettings()
        self.radius_m = self.settings.range_m

    def velocities(self, flock: Flock, preferred: Array, around: Surroundings) -> Array:
        """Returns commanded velocities (N, 2) m/s."""
        wanted = np.empty((len(flock.position), 2))
        _find_velocities(*flock, preferred, *around, self.settings, wanted)
        return wanted


@kernel
def _find_velocities(
    position: Any,
    velocity: Any,
    first: Any,
    neighbour: Any,
    preferred: Any,
    arena: Any,
    cylinders: Any,
    echoes: Any,
    settings: OlfatiSaberSettings,
    wanted: Any,
) -> None:
    """Fills the wanted velocities (N, 2)."""
    for i in range(len(position)):
        px, py, vx, vy = position[i, 0], position[i, 1], velocity[i, 0], velocity[i, 1]
        ax = settings.goal_gain * (preferred[i, 0] - vx)
        ay = settings.goal_gain * (preferred[i, 1] - vy)
        for j in neighbour[first[i] : first[i + 1]]:
            x, y = position[j, 0] - px, position[j, 1] - py
            ux, uy = velocity[j, 0] - vx, velocity[j, 1] - vy
            bx, by = _of_neighbour(x, y, ux, uy, settings)
            ax, ay = ax + bx, ay + by
        for side in range(4):
            axis = side % 2
            if abs(arena[side]) == math.inf:
                continue
            away = arena[side] - position[i, axis]
            x, y = (away, 0.0) if axis == 0 else (0.0, away)
            ux, uy = (-vx, 0.0) if axis == 0 else (0.0, -vy)
            bx, by = _of_obstacle(x, y, ux, uy, settings)
            ax, ay = ax + bx, ay + by
        for k in range(len(cylinders)):
            x, y = cylinders[k, 0] - px, cylinders[k, 1] - py
            bx, by = _of_cylinder(x, y, cylinders[k, 2], vx, vy, settings)
            ax, ay = ax + bx, ay + by
        for k in range(echoes.shape[1]):
            x, y = echoes[i, k, 0], echoes[i, k, 1]
            if not math.isnan(x):
                bx, by = _of_cylinder(x, y, 0.0, vx, vy, settings)
                ax, ay = ax + bx, ay + by
        wx, wy = vx + settings.response_s * ax, vy + settings.response_s * ay
        part = min(1.0, settings.max_speed_m_s / max(math.hypot(wx, wy), 1e-9))
        wanted[i, 0], wanted[i, 1] = part * wx, part * wy


@inner_kernel
def _of_neighbour(
    x: float, y: float, ux: float, uy: float, settings: OlfatiSaberSettings
) -> tuple[float, float]:
    """Returns the acceleration by a neighbour at (x, y) with the relative velocity (ux, uy)."""
    square = x * x + y * y
    near = _bump(_smooth(square) / _smooth(settings.range_m**2), _FLAT_UAVS)
    low, high = settings.attraction, settings.repulsion
    offset = abs(low - high) / math.sqrt(4.0 * low * high)
    action = _sigmoid(_smooth(square) - _smooth(settings.distance_m**2) + offset)
    force = 0.5 * near * ((low + high) * action + (low - high))
    force *= settings.lattice_gain / math.sqrt(1.0 + _EPSILON * square)
    match = settings.matching_gain * near
    return force * x + match * ux, force * y + match * uy


@inner_kernel
def _of_cylinder(
    x: float, y: float, radius: float, vx: float, vy: float, settings: OlfatiSaberSettings
) -> tuple[float, float]:
    """Returns the acceleration by a cylinder with its middle at (x, y), at a velocity (vx, vy)."""
    distance = max(math.hypot(x, y), 1e-6)
    x, y = x / distance, y / distance
    around, along = radius / distance, x * vy - y * vx
    ux, uy = -around * along * y - vx, around * along * x - vy
    away = max(distance - radius, 1e-3)
    return _of_obstacle(away * x, away * y, ux, uy, settings)


@inner_kernel
def _of_obstacle(
    x: float, y: float, ux: float, uy: float, settings: OlfatiSaberSettings
) -> tuple[float, float]:
    """Returns the acceleration by the nearest point (x, y) of an obstacle."""
    square = x * x + y * y
    keep = _smooth(settings.obstacle_m**2)
    near = _bump(_smooth(square) / keep, _FLAT_OBSTACLES)
    force = near * (_sigmoid(_smooth(square) - keep) - 1.0)
    force *= settings.obstacle_gain / math.sqrt(1.0 + _EPSILON * square)
    match = settings.sliding_gain * near
    return force * x + match * ux, force * y + match * uy


@inner_kernel
def _smooth(square: float) -> float:
    """Returns the smooth norm of a vector with this square."""
    return (math.sqrt(1.0 + _EPSILON * square) - 1.0) / _EPSILON


@inner_kernel
def _sigmoid(x: float) -> float:
    return x / math.sqrt(1.0 + x * x)


@inner_kernel
def _bump(x: float, flat: float) -> float:
    """Returns 1 up to `flat`, falling to 0 at 1."""
    if x < flat:
        return 1.0
    return 0.5 * (1.0 + math.cos(math.pi * (x - flat) / (1.0 - flat))) if x < 1.0 else 0.0
