"""Velocities that half planes allow, and the one that a UAV prefers to be out of others' way.

The choice is that of J. van den Berg, S. Guy, M. Lin, D. Manocha, "Reciprocal n-body collision
avoidance", ISRR 2009: the allowed velocity nearest to a preferred one (section 5.1), or the one
that gives way to all neighbours as equally as possible (section 5.3).
"""

from __future__ import annotations

import math
from typing import Any

from volery.autonomy.planning.reciprocal_avoidance import half_plane
from volery.core.compiled import inner_kernel

_EQUAL = 1e-9
"""Numbers that differ by less count as equal: borders of half planes coincide."""
_FAR = 1e4
"""Of the largest speed: the distance of a velocity that stands for a direction."""


@inner_kernel
def give_way(
    position: Any,
    preferred: Any,
    i: int,
    near: Any,
    distance_m: float,
    give_way_s: float,
    step_s: float,
    limit: float,
    planes: Any,
    relaxed: Any,
) -> tuple[bool, float, float]:
    """Returns whether UAV i leaves its preferred velocity for neighbours, and what it prefers then.

    It gives way to those that prefer to fly faster, as if they did, and does the whole avoidance.
    """
    vx, vy = preferred[i, 0], preferred[i, 1]
    speed, found, is_clear = math.hypot(vx, vy), 0, True
    for j in near:
        ux, uy = preferred[j, 0], preferred[j, 1]
        if math.hypot(ux, uy) <= speed + _EQUAL:
            continue
        nx, ny, change = half_plane(
            position[j, 0] - position[i, 0],
            position[j, 1] - position[i, 1],
            vx - ux,
            vy - uy,
            distance_m,
            give_way_s,
            step_s,
        )
        planes[found, 0], planes[found, 1], planes[found, 2] = nx, ny, nx * vx + ny * vy + change
        is_clear &= change <= 0.0
        found += 1
    if is_clear:
        return False, vx, vy
    x, y = choose_velocity(planes, 0, found, vx, vy, limit, relaxed)
    return True, x, y


@inner_kernel
def choose_velocity(
    planes: Any, hard: int, end: int, vx: float, vy: float, limit: float, relaxed: Any
) -> tuple[float, float]:
    """Returns the velocity nearest to (vx, vy) that the half planes allow, or violates least.

    planes: (K, 3) nx, ny, c: allowed are velocities with n . v >= c; the first `hard` always hold.
    """
    found, x, y = _nearest(planes, end, vx, vy, limit)
    if found == end:
        return x, y
    if found < hard:  # within too many obstacles: as well as possible
        hard = 0
    violation = 0.0
    for k in range(found, end):
        nx, ny, c = planes[k, 0], planes[k, 1], planes[k, 2]
        if c - (nx * x + ny * y) <= violation:
            continue
        for j in range(k):  # where none of these is violated more than plane k
            if j < hard:
                mx, my, d = planes[j, 0], planes[j, 1], planes[j, 2]
            else:
                mx, my, d = planes[j, 0] - nx, planes[j, 1] - ny, planes[j, 2] - c
                size = math.hypot(mx, my)
                mx, my, d = (
                    (mx / size, my / size, d / size) if size > _EQUAL else (1.0, 0.0, -math.inf)
                )
            relaxed[j, 0], relaxed[j, 1], relaxed[j, 2] = mx, my, d
        best, bx, by = _nearest(relaxed, k, _FAR * limit * nx, _FAR * limit * ny, limit)
        if best == k:
            x, y = bx, by
        violation = c - (nx * x + ny * y)
    return x, y


@inner_kernel
def _nearest(planes: Any, end: int, vx: float, vy: float, limit: float) -> tuple[int, float, float]:
    """Returns the allowed velocity nearest to (vx, vy), of at most a speed `limit`.

    The number is `end`, or that of the first half plane that cannot be kept with those before it.
    """
    part = min(1.0, limit / max(math.hypot(vx, vy), 1e-9))
    x, y = part * vx, part * vy
    for k in range(end):
        nx, ny, c = planes[k, 0], planes[k, 1], planes[k, 2]
        if nx * x + ny * y >= c - _EQUAL:
            continue
        if abs(c) > limit:  # the border is out of reach
            return k, x, y
        half_length = math.sqrt(limit * limit - c * c)
        low, high = -half_length, half_length
        for j in range(k):  # the border is c n + t (-ny, nx)
            along = planes[j, 1] * nx - planes[j, 0] * ny
            missing = planes[j, 2] - c * (planes[j, 0] * nx + planes[j, 1] * ny)
            if abs(along) < _EQUAL:
                if missing > _EQUAL:
                    return k, x, y
            elif along > 0.0:
                low = max(low, missing / along)
            else:
                high = min(high, missing / along)
        if low > high:
            return k, x, y
        t = min(max(vy * nx - vx * ny, low), high)
        x, y = c * nx - t * ny, c * ny + t * nx
    return end, x, y
