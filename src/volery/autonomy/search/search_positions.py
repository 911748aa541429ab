"""Positions of a cooperative search: random waypoints, and positions around a detection."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from volery.core import rng
from volery.core.arrays import Array
from volery.core.errors import GraphError
from volery.core.plurals import counted


class Area(NamedTuple):
    """A rectangle along the axes of the map, m."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float

    def holds(self, x: float, y: float) -> bool:
        """Returns whether a position lies in the area or on its border."""
        return self.x_min <= x <= self.x_max and self.y_min <= y <= self.y_max

    def without_border(self, width_m: float) -> Area:
        """Returns the area inside a border. Raises GraphError if it is empty."""
        inner = Area(
            self.x_min + width_m, self.y_min + width_m, self.x_max - width_m, self.y_max - width_m
        )
        if not (inner.x_min <= inner.x_max and inner.y_min <= inner.y_max):
            raise GraphError(
                f"search: area {list(self)} m must be wider than its borders of {width_m} m"
            )
        return inner


def random_waypoint(area: Area, key: np.uint64, number: int) -> Array:
    """Returns waypoint `number` (2,) m of the random stream `key`, uniform in the area."""
    across, along = (float(rng.uniform(key, 2 * number + k)) for k in range(2))
    return np.array(
        [
            area.x_min + across * (area.x_max - area.x_min),
            area.y_min + along * (area.y_max - area.y_min),
        ]
    )


def positions_around(position: Array, count: int, separation_m: float, area: Area) -> Array:
    """Returns positions (count, 2) in the area, `separation_m` apart and from `position`.

    They lie on rings around `position` (2,), the nearest ones first, and depend on the arguments
    only. A `position` outside of the area is moved to its border. Raises GraphError if there is no
    room; `check_room` checks this for all positions of an area.
    """
    middle = np.clip(position[:2], area[:2], area[2:])
    found: list[Array] = []
    widest = math.hypot(area.x_max - area.x_min, area.y_max - area.y_min)
    for ring in range(1, math.ceil(widest / separation_m) + 1):
        # six points on a circle are its radius apart, 6 k on a k times wider one slightly more
        steps = min(count, 6) if ring == 1 else 6 * ring
        found += _on_ring(middle, separation_m * ring, steps, area)
        if len(found) >= count:
            return np.array(found[:count])
    raise GraphError(
        f"search: area {list(area)} m has no room for {counted(count, 'position')} "
        f"{separation_m} m apart"
    )


def check_room(count: int, separation_m: float, area: Area) -> None:
    """Raises GraphError unless `search_positions` finds room around every position of the area.

    Each position has a quarter circle with a radius of half the shorter side in the area; on it
    every ring k but the first has at least 1.5 k positions.
    """
    rings, sure = 1, 0
    while sure < count:
        rings += 1
        sure += 3 * rings // 2
    min_side = 2.0 * rings * separation_m
    if min(area.x_max - area.x_min, area.y_max - area.y_min) < min_side:
        raise GraphError(
            f"search: {counted(count, 'UAV')} {separation_m} m apart need an area of "
            f"{min_side:g} m a side at least, without its borders, not {list(area)} m"
        )


def _on_ring(middle: Array, radius: float, steps: int, area: Area) -> list[Array]:
    angles = [2.0 * math.pi * step / steps for step in range(steps)]
    ring = [middle + radius * np.array([math.cos(a), math.sin(a)]) for a in angles]
    return [spot for spot in ring if area.holds(*spot)]
