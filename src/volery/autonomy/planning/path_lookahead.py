"""A way of straight legs, and the place on it that is flown to next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class PathLookahead:
    """Places (K, 3) m, K > 0; what has been passed is not come back to."""

    def __init__(self, places: Array, passed_m: float = 0.0) -> None:
        self.places = places
        lengths = np.linalg.norm(np.diff(places[:, :2], axis=0), axis=1)
        self._along = np.concatenate([[0.0], np.cumsum(lengths)])
        self.passed_m = min(passed_m, float(self._along[-1]))
        """How far along it the vehicle has come, m."""

    @property
    def goal(self) -> Array:
        """Its end, (3,)."""
        return np.asarray(self.places[-1])

    def left_m(self, place: Array) -> float:
        """How far it is to the end, in plan, from a place beside it."""
        return float(
            self._along[-1] - self.passed_m + np.hypot(*(self._at(self.passed_m) - place[:2]))
        )

    def carrot(self, place: Array, ahead_m: float, search_m: float = 15.0) -> Array:
        """The place (2,) `ahead_m` further along than where the vehicle has come to.

        It has come to the nearest place of the next `search_m`.
        """
        steps = np.arange(self.passed_m, min(self.passed_m + search_m, self._along[-1]) + 0.25, 0.5)
        away = np.hypot(*(self._at(steps) - place[:2, None]))
        self.passed_m = float(min(steps[int(np.argmin(away))], self._along[-1]))
        return self._at(min(self.passed_m + ahead_m, self._along[-1]))

    def _at(self, along: float | Array) -> Array:
        """(2, ...) so far along."""
        return np.array([np.interp(along, self._along, self.places[:, axis]) for axis in range(2)])
