"""A path of straight legs and its lookahead point."""

from __future__ import annotations

import numpy as np

from volery.core.arrays import Array


class PathLookahead:
    """Tracks progress along positions (K, 3) m, K > 0; progress never decreases."""

    def __init__(self, places: Array, passed_m: float = 0.0) -> None:
        self.places = places
        lengths = np.linalg.norm(np.diff(places[:, :2], axis=0), axis=1)
        self._along = np.concatenate([[0.0], np.cumsum(lengths)])
        self.passed_m = min(passed_m, float(self._along[-1]))
        """Progress along the path, m."""

    @property
    def goal(self) -> Array:
        """Returns the end of the path, (3,) m."""
        return np.asarray(self.places[-1])

    def left_m(self, place: Array) -> float:
        """Returns the distance (m) along the path to its end, from a position beside it."""
        return float(
            self._along[-1] - self.passed_m + np.hypot(*(self._at(self.passed_m) - place[:2]))
        )

    def lookahead_point(self, place: Array, ahead_m: float, search_m: float = 15.0) -> Array:
        """Updates the progress and returns the point (2,) m `ahead_m` further along the path.

        Progress becomes the point nearest to `place` within the next `search_m`.
        """
        steps = np.arange(self.passed_m, min(self.passed_m + search_m, self._along[-1]) + 0.25, 0.5)
        away = np.hypot(*(self._at(steps) - place[:2, None]))
        self.passed_m = float(min(steps[int(np.argmin(away))], self._along[-1]))
        return self._at(min(self.passed_m + ahead_m, self._along[-1]))

    def _at(self, along: float | Array) -> Array:
        """Returns the point (2, ...) at a distance along the path."""
        return np.array([np.interp(along, self._along, self.places[:, axis]) for axis in range(2)])
