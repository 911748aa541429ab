"""Gaps between obstacles in a polar view, and the heading that leads through the best one.

After the vector field histogram (Borenstein & Koren 1991; VFH+, Ulrich & Borenstein 1998): each
obstacle, widened by the safe radius, blocks the headings that would touch it; a gap is a run of
headings free out to some distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SECTORS = 180
SECTOR_ANGLES: Array = np.linspace(-np.pi, np.pi, SECTORS, endpoint=False) + np.pi / SECTORS
SECTOR_ANGLES.flags.writeable = False


def free_distances(obstacles: Array, safe_radius: float, reach: float) -> Array:
    """How far a disc of `safe_radius` could move along each of `SECTOR_ANGLES`, at most `reach`.

    `obstacles` is (K, 2), relative to the disc, m. An obstacle nearer than the safe radius blocks
    only the half plane towards it, so that a way out stays open.
    """
    free = np.full(SECTORS, reach)
    if len(obstacles) == 0:
        return free
    distance = np.hypot(obstacles[:, 0], obstacles[:, 1])
    along = obstacles[:, 0, None] * np.cos(SECTOR_ANGLES) + obstacles[:, 1, None] * np.sin(
        SECTOR_ANGLES
    )
    aside_squared = distance[:, None] ** 2 - along**2
    hits = (along > 0.0) & (aside_squared < safe_radius**2)
    until = along - np.sqrt(np.maximum(safe_radius**2 - aside_squared, 0.0))
    blocked = np.where(hits, np.maximum(until, 0.0), reach)
    return np.asarray(np.minimum(free, blocked.min(axis=0)))


@dataclass(frozen=True)
class Heading:
    """A chosen direction, rad in the frame of the obstacles, and how far it is free, m."""

    angle: float
    free_m: float


def choose_heading(
    free: Array, goal_angle: float, goal_distance: float, previous_angle: float | None
) -> Heading | None:
    """Direction of the best gap, or None when every way is blocked.

    Wants gaps that are free far ahead and settles for nearer ones; within a gap it prefers what
    lies nearest to the goal's direction, with some loyalty to the previous choice.
    """
    for wanted in (9.0, 6.0, 4.0, 2.5, 1.2):
        needed = min(wanted, goal_distance)
        passable = free >= needed
        if not passable.any():
            continue
        off_goal = np.abs(wrap(SECTOR_ANGLES - goal_angle))
        cost = off_goal.copy()
        if previous_angle is not None:
            cost += 0.35 * np.abs(wrap(SECTOR_ANGLES - previous_angle))
        cost += 0.25 * (1.0 - np.minimum(free / 12.0, 1.0))
        cost[~passable] = np.inf
        best = int(np.argmin(cost))
        if off_goal[best] > 2.0 and wanted > 2.5:
            continue  # rather a near gap ahead than a far one behind
        return Heading(float(SECTOR_ANGLES[best]), float(free[best]))
    return None


def wrap(angle: Array) -> Array:
    """Angles to [-pi, pi)."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi)
