"""True trunk positions: those of the forest of a log's scenario, generated again."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from volery.bridges.logs.recorded_flight import RecordedScenario
from volery.core.arrays import Array
from volery.core.errors import VoleryError
from volery.runtime.construction.worlds import build_city, build_forest, build_terrain
from volery.runtime.replay.scenario_record import scenario_of

_NEAR_M = 15.0
"""Max distance to the trajectory, as in the detection by scans."""
_EVERY = 20
"""Poses between two that are checked: a second."""


class TrueTrunks(NamedTuple):
    """Trunks of T trees."""

    positions: Array
    """(T, 2) m, in the map."""
    widths_m: Array
    """(T,) m, diameter at breast height."""
    why_none: str = ""
    """Why there are none, as a sentence."""

    def near(self, path: Array) -> TrueTrunks:
        """Returns the trunks near the positions (N, 2 or 3) of a trajectory."""
        if not len(self.positions) or not len(path):
            return self
        seen = np.zeros(len(self.positions), np.bool_)
        for position in path[::_EVERY, :2]:
            seen |= np.hypot(*(self.positions - position).T) <= _NEAR_M
        return TrueTrunks(self.positions[seen], self.widths_m[seen], self.why_none)

    def distances_m(self, found: Array) -> Array:
        """Returns distances (F,) m to the nearest trunk; empty without trunks.

        found: positions (F, 2 or 3) m.
        """
        if not len(self.positions):
            return np.zeros(0)
        return np.array([np.hypot(*(self.positions - position[:2]).T).min() for position in found])


def no_trunks(why: str) -> TrueTrunks:
    """Returns no trunks, with the reason."""
    return TrueTrunks(np.zeros((0, 2)), np.zeros(0), why)


def true_trunks(origin: RecordedScenario | None, folder: Path | None = None) -> TrueTrunks:
    """Returns all trunks of the recorded scenario of a log in `folder`."""
    if origin is None:
        return no_trunks("The log holds no scenario, so the true positions of trees are unknown.")
    try:
        scenario = scenario_of(origin, folder=folder)
        terrain = build_terrain(scenario)
        forest = build_forest(scenario, terrain, build_city(scenario, terrain))
    except VoleryError as error:
        return no_trunks(f"The scenario's trees cannot be generated again: {error}.")
    if not forest:
        return no_trunks("The scenario has no trees.")
    return TrueTrunks(forest.position_map[:, :2], np.asarray(forest.dbh_m, np.float64))
