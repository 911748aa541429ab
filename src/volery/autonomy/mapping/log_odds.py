"""An occupancy grid from rays with known poses: log-odds of each cell, seen from above.

H. Moravec and A. Elfes, High resolution maps from wide angle sonar, ICRA 1985. A hit makes its cell
more likely occupied, a passing ray free; within one scan a hit outweighs all rays that pass its
cell, so that thin objects remain.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.compiled import kernel

_HIT, _MISS, _MIN_ODDS, _MAX_ODDS = 0.85, 0.4, -4.0, 6.0
"""ln of the odds of a scan's hit (0.70) and miss (0.60), and bounds (modelling choices)."""
OCCUPIED, FREE, UNKNOWN = 100, 0, -1
"""As in nav_msgs/OccupancyGrid."""
_OCCUPIED, _FREE = 0.6, -0.3
"""Log-odds beyond which a cell counts as such: after one scan, unless others contradict."""


class LogOddsGrid:
    """A grid over a box: `low`, `high` (2,) m in the map."""

    def __init__(self, low: Array, high: Array, cell_m: float) -> None:
        self.cell_m = cell_m
        self.origin = np.floor(low / cell_m) * cell_m
        """(2,) m, the lower left corner."""
        columns, rows = np.ceil((high - self.origin) / cell_m).astype(int) + 1
        self.odds = np.zeros((int(rows), int(columns)), np.float32)
        """Rows along y, columns along x; 0 is unknown."""
        self._scan = np.zeros(self.odds.shape, np.int32)
        self._number = 0

    def add(self, starts: Array, ends: Array, hits: NDArray[np.bool_]) -> None:
        """Adds the rays of one scan, (K, 2) m in the map."""
        self._number += 2
        _draw(
            np.ascontiguousarray(starts), np.ascontiguousarray(ends), hits, self.origin,
            self.cell_m, self._number, self.odds, self._scan,
        )  # fmt: skip

    def occupancy(self) -> NDArray[np.int8]:
        """Returns `OCCUPIED`, `FREE` or `UNKNOWN` (rows, columns)."""
        values = np.full(self.odds.shape, UNKNOWN, np.int8)
        values[self.odds > _OCCUPIED] = OCCUPIED
        values[self.odds < _FREE] = FREE
        return values


@kernel
def _draw(
    starts: Array,
    ends: Array,
    hits: NDArray[np.bool_],
    origin: Array,
    cell: float,
    number: int,
    odds: NDArray[np.float32],
    scan: NDArray[np.int32],
) -> None:
    """Adds hits first, stamped with `number`, then misses, with `number` - 1, once per cell."""
    rows, columns = odds.shape
    for k in range(len(hits)):
        i = math.floor((ends[k, 1] - origin[1]) / cell)
        j = math.floor((ends[k, 0] - origin[0]) / cell)
        if hits[k] and 0 <= i < rows and 0 <= j < columns and scan[i, j] != number:
            scan[i, j] = number
            odds[i, j] = min(odds[i, j] + _HIT, _MAX_ODDS)
    for k in range(len(hits)):
        x, y = starts[k, 0], starts[k, 1]
        dx, dy = ends[k, 0] - x, ends[k, 1] - y
        steps = math.ceil(2.0 * max(abs(dx), abs(dy)) / cell)
        for step in range(steps):
            fraction = step / steps
            i = math.floor((y + fraction * dy - origin[1]) / cell)
            j = math.floor((x + fraction * dx - origin[0]) / cell)
            if not (0 <= i < rows and 0 <= j < columns):
                continue
            if scan[i, j] < number - 1:
                scan[i, j] = number - 1
                odds[i, j] = max(odds[i, j] - _MISS, _MIN_ODDS)
