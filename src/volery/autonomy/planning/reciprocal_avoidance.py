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
from volery.core.vectors import norm


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
        place = other.position + age * other.velocity
        if abs(place[2] - position[2]) > separation.height_m:
            continue
        radius = separation.radius_m + age * separation.growth_m_s
        planes.append(
            _half_plane(
                place[:2] - position[:2], velocity[:2], other.velocity[:2], radius, separation
            )
        )
    return planes


def _half_plane(
    way: Array, own: Array, others: Array, radius: float, separation: Separation
) -> HalfPlane:
    """Computes a half plane by section 4 of the paper; `change` is its `u`."""
    relative = own - others
    square = float(way @ way)
    too_near = square <= radius * radius
    horizon = separation.step_s if too_near else separation.horizon_s
    from_centre = relative - way / horizon
    length = norm(from_centre)
    ahead = float(from_centre @ way)
    cut_off = ahead < 0.0 and ahead * ahead > radius * radius * length * length
    if too_near or cut_off:  # nearest to the round end of the cone
        if length > 1e-9:
            normal = from_centre / length
        elif square > 1e-18:
            normal = -way / math.sqrt(square)
        else:
            normal = np.array([1.0, 0.0])
        change = (radius / horizon - length) * normal
    else:
        leg = math.sqrt(square - radius * radius)
        left = float(way[0] * from_centre[1] - way[1] * from_centre[0]) > 0.0
        if left:
            along = np.array([way[0] * leg - way[1] * radius, way[0] * radius + way[1] * leg])
        else:
            along = -np.array([way[0] * leg + way[1] * radius, -way[0] * radius + way[1] * leg])
        along = along / square
        change = float(relative @ along) * along - relative
        normal = np.array([-along[1], along[0]])
    return HalfPlane(own + 0.5 * change, normal)


def violation(planes: Sequence[HalfPlane], velocities: Array) -> Array:
    """Returns the max violation (m/s) of the constraints by each velocity (C, 2)."""
    worst = np.zeros(len(velocities))
    for plane in planes:
        worst = np.maximum(worst, (plane.point - velocities) @ plane.normal)
    return worst
