"""Selects the next viewpoint: the best gain for the distance.

Next-best-view by utility of gain and distance, after H. Gonzalez-Banos and J.-C. Latombe,
"Navigation strategies for exploring indoor environments", IJRR 2002.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from volery.autonomy.planning.search_area import SearchArea
from volery.core.arrays import Array

_TURN = 0.1
_PATH_SCALE_M = 80.0
"""Costs, in view discs: a reversal costs a tenth, a path of 80 m a whole disc (modelling
choices).
"""
_MIN_FRACTION = 0.06
"""Min fraction of the view disc that must be new."""
_APART_M = 2.0
"""Min distance between viewpoints and excluded positions."""


class Viewpoint(NamedTuple):
    """Position (2,) m of a viewpoint, and the new area m^2 that it observes."""

    position: Array
    gain_m2: float


def next_viewpoint(
    area: SearchArea,
    position: Array,
    heading: float,
    view_m: float,
    left_out: Sequence[Array] = (),
) -> Viewpoint | None:
    """Returns the best viewpoint from `position` (2,) m; None if no gain is worth the distance.

    heading: of the flight, rad. left_out: positions (2,) that are unreachable or were visited.
    """
    spots = _lattice(area, 0.5 * view_m)
    for bad in left_out:
        spots = spots[np.hypot(*(spots - bad).T) > _APART_M]
    if len(spots) == 0:
        return None
    gains, worths = area.gains(spots, view_m)
    disc = math.pi * view_m**2
    enough = gains >= _MIN_FRACTION * disc
    if not enough.any():
        return None
    spots, gains, worths = spots[enough], gains[enough], worths[enough]
    offsets = spots - position
    length = np.hypot(offsets[:, 0], offsets[:, 1])
    turn = np.abs(np.arctan2(offsets[:, 1], offsets[:, 0]) - heading)
    turn = np.minimum(turn, 2.0 * math.pi - turn) / math.pi
    utility = worths / disc - length / _PATH_SCALE_M - _TURN * turn
    best = int(np.argmax(utility))
    return Viewpoint(spots[best], float(gains[best]))


def _lattice(area: SearchArea, step_m: float) -> Array:
    """Returns candidate positions (K, 2) all over the area."""
    every = max(1, round(step_m / area.cell_m))
    middles = area.middles(area.inside.shape)
    rows = slice(every // 2, None, every)
    chosen = middles[rows, rows][area.inside[rows, rows]]
    return chosen if len(chosen) else middles[area.inside][:1]
