"""The trunks that truly stood there: the forest of a log's scenario, grown once more."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.bridges.logs.recorded_flight import RecordedScenario
from volery.core.errors import VoleryError
from volery.runtime.build.worlds import build_city, build_forest, build_terrain
from volery.runtime.replay.scenario_record import scenario_of

Array = NDArray[np.float64]

_NEAR_M = 15.0
"""Of the way, as far as trunks are looked for in scans."""
_EVERY = 20
"""Poses between two that are looked from: a second."""


class TrueTrunks(NamedTuple):
    """Of T trees."""

    places: Array
    """(T, 2) m, in the map."""
    widths_m: Array
    """(T,) at breast height."""
    why_none: str = ""
    """Why there are none, a sentence."""

    def near(self, way: Array) -> TrueTrunks:
        """Those within reach of the places (N, 2 or 3) of a way."""
        if not len(self.places) or not len(way):
            return self
        seen = np.zeros(len(self.places), np.bool_)
        for place in way[::_EVERY, :2]:
            seen |= np.hypot(*(self.places - place).T) <= _NEAR_M
        return TrueTrunks(self.places[seen], self.widths_m[seen], self.why_none)

    def distances_m(self, found: Array) -> Array:
        """(F,) from places (F, 2 or 3) to the nearest trunk; empty where there is none."""
        if not len(self.places):
            return np.zeros(0)
        return np.array([np.hypot(*(self.places - place[:2]).T).min() for place in found])


def no_trunks(why: str) -> TrueTrunks:
    """None, and why."""
    return TrueTrunks(np.zeros((0, 2)), np.zeros(0), why)


def true_trunks(origin: RecordedScenario | None, folder: Path | None = None) -> TrueTrunks:
    """All trunks of the scenario that a log in `folder` tells of."""
    if origin is None:
        return no_trunks("The log tells of no scenario, so where trees truly stood is not known.")
    try:
        scenario = scenario_of(origin, folder=folder)
        terrain = build_terrain(scenario)
        forest = build_forest(scenario, terrain, build_city(scenario, terrain))
    except VoleryError as error:
        return no_trunks(f"The scenario's trees cannot be grown once more: {error}.")
    if not forest:
        return no_trunks("The scenario has no trees.")
    return TrueTrunks(forest.position_map[:, :2], np.asarray(forest.dbh_m, np.float64))
