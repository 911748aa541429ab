"""Where to look next: the place from which most is seen for the way there.

Next-best-view by utility of gain and way, after H. Gonzalez-Banos and J.-C. Latombe, "Navigation
strategies for exploring indoor environments", IJRR 2002.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.planning.search_area import SearchArea

Array = NDArray[np.float64]

_TURN = 0.1
_WAY_M = 80.0
"""Prices, in discs of sight: a turn back costs a tenth, 80 m of way a whole one (modelling
choices)."""
_LEAST_SHARE = 0.06
"""Of the disc of sight must be new, else it is not worth the way."""
_APART_M = 2.0
"""So near to a place that is left out none is tried."""


class Viewpoint(NamedTuple):
    """A place (2,) m to look from, and the area m^2 that would be new there."""

    place: Array
    gain_m2: float


def next_viewpoint(
    area: SearchArea,
    place: Array,
    heading: float,
    view_m: float,
    left_out: Sequence[Array] = (),
) -> Viewpoint | None:
    """The best place to go to from `place` (2,) m; None where nothing is worth the way.

    heading: of the flight, rad. left_out: places (2,) that could not be reached, or have been
    looked from.
    """
    spots = _lattice(area, 0.5 * view_m)
    for bad in left_out:
        spots = spots[np.hypot(*(spots - bad).T) > _APART_M]
    if len(spots) == 0:
        return None
    gains, worths = area.gains(spots, view_m)
    disc = math.pi * view_m**2
    enough = gains >= _LEAST_SHARE * disc
    if not enough.any():
        return None
    spots, gains, worths = spots[enough], gains[enough], worths[enough]
    way = spots - place
    length = np.hypot(way[:, 0], way[:, 1])
    turn = np.abs(np.arctan2(way[:, 1], way[:, 0]) - heading)
    turn = np.minimum(turn, 2.0 * math.pi - turn) / math.pi
    utility = worths / disc - length / _WAY_M - _TURN * turn
    best = int(np.argmax(utility))
    return Viewpoint(spots[best], float(gains[best]))


def _lattice(area: SearchArea, step_m: float) -> Array:
    """Places (K, 2) all over the area."""
    every = max(1, round(step_m / area.cell_m))
    middles = area.middles(area.inside.shape)
    rows = slice(every // 2, None, every)
    chosen = middles[rows, rows][area.inside[rows, rows]]
    return chosen if len(chosen) else middles[area.inside][:1]
