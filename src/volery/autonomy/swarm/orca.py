"""Optimal reciprocal collision avoidance of a swarm: each UAV does half of every avoidance.

J. van den Berg, S. Guy, M. Lin, D. Manocha, "Reciprocal n-body collision avoidance", ISRR 2009.
Each neighbour allows a half plane of velocities; of those that all allow, a UAV chooses the one
nearest to its preferred velocity (section 5.1). Where there is none, it gives way to all
neighbours as equally as possible (section 5.3), but not to obstacles, which it approaches only as
fast as it may brake.

By these rules alone, UAVs that have arrived block those behind: a UAV that prefers to stay yields
only to one that touches it. Therefore a UAV prefers to be out of the way of neighbours that prefer
to fly faster than itself, as those farther from their goals do. This changes what it prefers, and
not what is allowed.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from volery.autonomy.planning.reciprocal_avoidance import half_plane
from volery.autonomy.swarm.behaviour import Flock, Surroundings
from volery.autonomy.swarm.velocity_choice import choose_velocity, give_way
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel


class OrcaSettings(NamedTuple):
    """Parameters of the avoidance."""

    distance_m: float = 2.0
    """Minimum distance between the centres of two UAVs."""
    horizon_s: float = 4.0
    """Time ahead in which they keep it."""
    step_s: float = 0.5
    """Time in which UAVs that are nearer part."""
    obstacle_m: float = 1.0
    """Minimum distance of a UAV's centre from obstacles."""
    braking_s: float = 1.2
    """Time in which a UAV may reach that distance at its present speed."""
    turn_rad: float = 0.35
    """Turn to the right of a preferred velocity that a neighbour forbids; without it, UAVs that
    meet symmetrically stop."""
    give_way_s: float = 1.0
    """Time ahead in which a UAV is out of the way of those that prefer to fly faster."""
    max_speed_m_s: float = 5.0


class Orca:
    """Avoids all others reciprocally; implements `SwarmBehaviour`."""

    def __init__(self, settings: OrcaSettings | None = None) -> None:
        self.settings = chosen = settings or OrcaSettings()
        self.radius_m = chosen.distance_m + 2.0 * chosen.max_speed_m_s * chosen.horizon_s

    def velocities(self, flock: Flock, preferred: Array, around: Surroundings) -> Array:
        """Returns commanded velocities (N, 2) m/s."""
        wanted = np.empty((len(flock.position), 2))
        _choose_all(*flock, np.array(preferred, float), *around, self.settings, wanted)
        return wanted


@kernel
def _choose_all(
    position: Any,
    velocity: Any,
    first: Any,
    neighbour: Any,
    preferred: Any,
    arena: Any,
    cylinders: Any,
    echoes: Any,
    settings: OrcaSettings,
    wanted: Any,
) -> None:
    """Fills the wanted velocities (N, 2)."""
    count = len(position)
    num_obstacles = 4 + len(cylinders) + echoes.shape[1]
    max_planes = num_obstacles
    for i in range(count):
        max_planes = max(max_planes, num_obstacles + first[i + 1] - first[i])
    planes, passing, relaxed = (
        np.empty((max_planes, 3)),
        np.empty((max_planes, 3)),
        np.empty((max_planes, 3)),
    )
    for i in range(count):
        hard = _add_obstacles(planes, position, i, arena, cylinders, echoes, settings)
        end = hard
        near = neighbour[first[i] : first[i + 1]]
        for j in near:
            ux, uy = velocity[i, 0], velocity[i, 1]
            nx, ny, change = half_plane(
                position[j, 0] - position[i, 0],
                position[j, 1] - position[i, 1],
                ux - velocity[j, 0],
                uy - velocity[j, 1],
                settings.distance_m,
                settings.horizon_s,
                settings.step_s,
            )
            planes[end, 0], planes[end, 1] = nx, ny
            planes[end, 2] = nx * ux + ny * uy + 0.5 * change
            end += 1
        gives_way, vx, vy = give_way(
            position,
            preferred,
            i,
            near,
            settings.distance_m,
            settings.give_way_s,
            settings.step_s,
            settings.max_speed_m_s,
            passing,
            relaxed,
        )
        is_forbidden = False
        for k in range(hard, end):
            is_forbidden |= planes[k, 0] * vx + planes[k, 1] * vy < planes[k, 2]
        if is_forbidden and not gives_way:
            c, s = math.cos(settings.turn_rad), math.sin(settings.turn_rad)
            vx, vy = c * vx + s * vy, c * vy - s * vx
        wanted[i, 0], wanted[i, 1] = choose_velocity(
            planes, hard, end, vx, vy, settings.max_speed_m_s, relaxed
        )


@inner_kernel
def _add_obstacles(
    planes: Any,
    position: Any,
    i: int,
    arena: Any,
    cylinders: Any,
    echoes: Any,
    settings: OrcaSettings,
) -> int:
    """Fills half planes in which UAV i may approach obstacles; returns their number."""
    found = 0
    for side in range(4):
        axis, inwards = side % 2, -1.0 if side >= 2 else 1.0
        away = inwards * (position[i, axis] - arena[side])
        if away < math.inf:
            planes[found, axis], planes[found, 1 - axis] = inwards, 0.0
            planes[found, 2] = -_closing_speed(away, settings)
            found += 1
    for k in range(len(cylinders)):
        x, y = cylinders[k, 0] - position[i, 0], cylinders[k, 1] - position[i, 1]
        found = _add_obstacle(planes, found, x, y, cylinders[k, 2], settings)
    for k in range(echoes.shape[1]):
        found = _add_obstacle(planes, found, echoes[i, k, 0], echoes[i, k, 1], 0.0, settings)
    return found


@inner_kernel
def _add_obstacle(
    planes: Any, found: int, x: float, y: float, radius: float, settings: OrcaSettings
) -> int:
    """Adds the half plane of a round obstacle at an offset, if there is one."""
    distance = max(math.hypot(x, y), 1e-6)
    speed = _closing_speed(distance - radius, settings)
    if not speed < settings.max_speed_m_s:  # far, or no obstacle: nan
        return found
    planes[found, 0], planes[found, 1], planes[found, 2] = -x / distance, -y / distance, -speed
    return found + 1


@inner_kernel
def _closing_speed(distance: float, settings: OrcaSettings) -> float:
    """Returns how fast a UAV may approach an obstacle at a distance; negative: it must part."""
    return (distance - settings.obstacle_m) / settings.braking_s
