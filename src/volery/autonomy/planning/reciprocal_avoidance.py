"""Optimal reciprocal collision avoidance between vehicles.

J. van den Berg, S. Guy, M. Lin, D. Manocha, "Reciprocal n-body collision avoidance", ISRR 2009, in
the plane. Each neighbour allows a half plane of velocities in which, if the neighbour does the
other half of the avoidance, both stay apart for `horizon_s`. Older positions are extrapolated by
their velocity; the radius grows with their age.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.compiled import inline_kernel

_NOTHING = 1e-9


class Neighbour(NamedTuple):
    """Last reported motion of another vehicle, in the frame of the avoiding vehicle."""

    position: Array
    """(3,) m."""
    velocity: Array
    """(3,) m/s."""
    time_ns: int


class Separation(NamedTuple):
    """Separation between vehicles."""

    radius_m: float = 1.5
    """Min horizontal distance between the centres of two vehicles."""
    height_m: float = 2.5
    """Height difference beyond which vehicles do not conflict."""
    horizon_s: float = 4.0
    """Time ahead for which velocities are free of conflict."""
    growth_m_s: float = 0.5
    """Growth of a neighbour's radius with the age of its report."""
    forget_s: float = 5.0
    """Age of a report beyond which the neighbour is ignored."""
    step_s: float = 0.2
    """Time in which vehicles that are already too near to each other separate."""


class HalfPlane(NamedTuple):
    """Velocities v with (v - point) . normal >= 0 are allowed, (2,) m/s."""

    point: Array
    normal: Array


def half_planes(
    position: Array,
    velocity: Array,
    neighbours: Sequence[Neighbour],
    separation: Separation,
    now_ns: int,
) -> list[HalfPlane]:
    """Returns constraints on the velocity (2,) m/s of a vehicle at `position` (3,) m."""
    planes = []
    for other in neighbours:
        age = (now_ns - other.time_ns) / NS_PER_S
        finite = np.isfinite(other.position).all() and np.isfinite(other.velocity).all()
        if not finite or not -1.0 <= age <= separation.forget_s:
            continue
        age = max(age, 0.0)
        other_position = other.position + age * other.velocity
        if abs(other_position[2] - position[2]) > separation.height_m:
            continue
        radius = separation.radius_m + age * separation.growth_m_s
        x, y = (other_position[:2] - position[:2]).tolist()
        vx, vy = (velocity[:2] - other.velocity[:2]).tolist()
        nx, ny, change = half_plane(x, y, vx, vy, radius, separation.horizon_s, separation.step_s)
        normal = np.array([nx, ny])
        planes.append(HalfPlane(velocity[:2] + 0.5 * change * normal, normal))
    return planes


@inline_kernel
def half_plane(
    x: float, y: float, vx: float, vy: float, radius: float, horizon_s: float, step_s: float
) -> tuple[float, float, float]:
    """Returns the direction (2) in which a relative velocity must change, and by how much (m/s).

    By section 4 of the paper: x, y, m, is the offset to the other vehicle and vx, vy, m/s, the
    velocity relative to it. A negative change is one that is allowed.
    """
    square = x * x + y * y
    is_near = square <= radius * radius
    horizon = step_s if is_near else horizon_s
    from_x, from_y = vx - x / horizon, vy - y / horizon
    length = math.sqrt(from_x * from_x + from_y * from_y)
    ahead = from_x * x + from_y * y
    if is_near or (ahead < 0.0 and ahead * ahead > radius * radius * length * length):
        # nearest to the round end of the cone
        if length > _NOTHING:
            nx, ny = from_x / length, from_y / length
        elif square > _NOTHING * _NOTHING:
            nx, ny = -x / math.sqrt(square), -y / math.sqrt(square)
        else:
            nx, ny = 1.0, 0.0
        return nx, ny, radius / horizon - length
    leg = math.sqrt(square - radius * radius)
    if x * from_y - y * from_x > 0.0:  # nearest to the left leg
        along_x, along_y = (x * leg - y * radius) / square, (x * radius + y * leg) / square
    else:
        along_x, along_y = -(x * leg + y * radius) / square, (x * radius - y * leg) / square
    return -along_y, along_x, vx * along_y - vy * along_x


def violation(planes: Sequence[HalfPlane], velocities: Array) -> Array:
    """Returns the max violation (m/s) of the constraints by each velocity (C, 2)."""
    worst = np.zeros(len(velocities))
    for plane in planes:
        worst = np.maximum(worst, (plane.point - velocities) @ plane.normal)
    return worst
