"""A planar submap, and the two methods to match a scan to it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from volery.autonomy.slam.planar.fit_kernels import fit
from volery.autonomy.slam.planar.map_kernels import CELL_M, blur, build, pool
from volery.autonomy.slam.planar.search_kernels import search
from volery.autonomy.slam.planar.settings import MatchingSettings
from volery.core.arrays import Array

_MAX_CELLS = 30_000
_NOWHERE = np.array([0.0, 0.0, -1.0])


class ScanMatch(NamedTuple):
    """A scan matched to a map."""

    pose: Array
    """(3,) pose."""
    information: Array
    """(3, 3) information of the scan alone on the pose."""
    met: float
    """Matched returns, weighted by how well they fit."""
    fraction: float
    """Fraction of all returns."""


class PlanarSubmap:
    """Holds walls within `half_width_m` of a centre.

    levels: of the search, whose largest squares are 2^(levels - 1) cells.
    """

    def __init__(self, half_width_m: float, levels: int, fitting: MatchingSettings) -> None:
        n = 2 * math.ceil(half_width_m / CELL_M)
        self._grid = np.full((n, n), -1, np.int32)
        self._cells = np.zeros((_MAX_CELLS, 2), np.int32)
        self._sums = np.zeros((_MAX_CELLS, 6))
        self._shapes = np.zeros((_MAX_CELLS, 6))
        self._fields = np.zeros((levels, n, n), np.uint8)
        self._corner = np.zeros(2)
        self._fitting = fitting
        self.count = 0
        """Number of occupied cells."""

    def draw(self, points: Array, middle: Array, min_count: float = 1.0) -> None:
        """Replaces the map by points (K, 2) around a pose.

        min_count: returns of a cell from which it counts in searches.
        """
        n = len(self._grid)
        self._corner = (np.floor(middle[:2] / CELL_M) - n // 2) * CELL_M
        points = np.ascontiguousarray(points)
        self.count = int(
            build(points, self._corner, self._grid, self._cells, self._sums, self._shapes)
        )
        blur(self._cells, self._sums, self.count, self._corner, min_count, self._fields[0])
        pool(self._fields)

    def fit(self, points: Array, start: Array, certainty: Array | None = None) -> ScanMatch:
        """Fits points (K, 2) to the map from a pose (3,), weighted by its `certainty` (3, 3)."""
        f = self._fitting
        pose, information = start.copy(), np.zeros((3, 3))
        held = 1e-3 * np.eye(3) if certainty is None else certainty
        met = float(
            fit(
                pose, start, held, points, self._grid, self._sums, self._shapes, self._corner,
                f.gate_m, f.sigma_m, f.trust, f.pull, f.unclear, f.rounds, information,
            )
        )  # fmt: skip
        pose[2] = math.remainder(pose[2], math.tau)
        return ScanMatch(pose, information, met, met / max(len(points), 1))

    def search(
        self,
        points: Array,
        middle: Array,
        window: Array,
        *,
        slope: Array | None = None,
        min_score: float = 0.0,
        shut: Array | None = None,
    ) -> tuple[Array, float]:
        """Returns the pose of points (K, 2) within `middle` (3,) +- `window` (3,) that scores best.

        slope: (3,) reduction of the score for each unit squared away from the centre. shut: a
        position and a radius that are excluded. The score is the fraction of matched returns, 0 if
        none is above `min_score`.
        """
        best = middle.copy()
        far = float(np.sqrt((points * points).sum(axis=1)).max()) if len(points) else 1.0
        step = CELL_M / max(min(far, 8.0), 1.0)
        none = np.zeros(3)
        score = search(
            points, self._fields, self._corner, middle, window, step,
            none if slope is None else slope, min_score, _NOWHERE if shut is None else shut, best,
        )  # fmt: skip
        best[2] = math.remainder(best[2], math.tau)
        return best, float(score)
