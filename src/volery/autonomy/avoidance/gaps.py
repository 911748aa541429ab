"""Finds gaps between obstacles in polar coordinates, and the heading through the best one.

After the vector field histogram (Borenstein & Koren 1991; VFH+, Ulrich & Borenstein 1998): each
obstacle, widened by the safe radius, blocks the headings that would touch it; a gap is a run of
headings free up to some distance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from volery.core.arrays import Array
from volery.core.compiled import kernel

SECTORS = 180
SECTOR_ANGLES: Array = np.linspace(-np.pi, np.pi, SECTORS, endpoint=False) + np.pi / SECTORS
SECTOR_ANGLES.flags.writeable = False

_LOOKS_AHEAD_M = (9.0, 6.0, 4.0, 2.5, 1.2)
"""Free distances to look for, in order of preference."""
_LOYALTY = 0.35
_OPENNESS = 0.25


def free_distances(obstacles: Array, safe_radius: float, max_range: float) -> Array:
    """Returns how far a disc of `safe_radius` can move along `SECTOR_ANGLES`, at most `max_range`.

    `obstacles` is (K, 2), relative to the disc, m. An obstacle nearer than the safe radius blocks
    only the half plane towards it, so that the UAV can move away.
    """
    free = np.full(SECTORS, max_range)
    _shorten(np.ascontiguousarray(obstacles, dtype=np.float64), safe_radius, free)
    return free


@kernel
def _shorten(obstacles: Array, safe_radius: float, free: Array) -> None:
    width = 2.0 * math.pi / SECTORS
    for k in range(obstacles.shape[0]):
        x, y = obstacles[k, 0], obstacles[k, 1]
        distance = math.sqrt(x * x + y * y)
        half = 0.5 * math.pi if distance <= safe_radius else math.asin(safe_radius / distance)
        bearing = math.atan2(y, x)
        first = math.ceil((bearing - half + math.pi) / width - 0.5)
        last = math.floor((bearing + half + math.pi) / width - 0.5)
        for sector in range(first, last + 1):
            off = -math.pi + (sector + 0.5) * width - bearing
            aside = distance * math.sin(off)
            inside = safe_radius * safe_radius - aside * aside
            until = max(distance * math.cos(off) - math.sqrt(max(inside, 0.0)), 0.0)
            s = sector % SECTORS
            free[s] = min(free[s], until)


@dataclass(frozen=True)
class GapHeading:
    """A chosen direction, rad in the frame of the obstacles, and its free distance, m."""

    angle: float
    free_m: float


def choose_heading(
    free: Array, goal_angle: float, goal_distance: float, previous_angle: float | None
) -> GapHeading | None:
    """Returns the direction of the best gap, or None if all directions are blocked.

    It prefers gaps with a long free distance, and within a gap directions near the goal's, with
    some weight on the previous choice.
    """
    off_goal = np.abs(wrap(SECTOR_ANGLES - goal_angle))
    cost = off_goal + _OPENNESS * (1.0 - np.minimum(free / 12.0, 1.0))
    if previous_angle is not None:
        cost += _LOYALTY * np.abs(wrap(SECTOR_ANGLES - previous_angle))
    for wanted in _LOOKS_AHEAD_M:
        passable = free >= min(wanted, goal_distance)
        if not passable.any():
            continue
        best = int(np.argmin(np.where(passable, cost, np.inf)))
        if off_goal[best] > 2.0 and wanted > 2.5:
            continue  # a near gap ahead is better than a far one behind
        return GapHeading(float(SECTOR_ANGLES[best]), float(free[best]))
    return None


def wrap(angle: Array) -> Array:
    """Wraps angles to [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)
