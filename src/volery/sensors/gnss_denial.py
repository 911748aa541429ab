"""Where satellite signals are denied: everywhere, or in prisms over parts of the map."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Prism(NamedTuple):
    """A polygon of the map, from a lowest to a highest z."""

    corners: Array
    """(C, 2) m, in order around; the last is joined to the first."""
    lowest: float = -math.inf
    highest: float = math.inf

    def contains(self, position: Array) -> NDArray[np.bool_]:
        """Which places (N, 3) lie in it, by the even-odd rule."""
        x, y, z = position.T
        inside = np.zeros(len(position), np.bool_)
        for (ax, ay), (bx, by) in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            crosses = (ay > y) != (by > y)
            if ay != by:
                inside ^= crosses & (x < ax + (y - ay) * (bx - ax) / (by - ay))
        return np.asarray(inside & (self.lowest <= z) & (z <= self.highest))


class GnssDenial(NamedTuple):
    """All that a scenario denies."""

    everywhere: bool = False
    prisms: tuple[Prism, ...] = ()

    def covers(self, position: Array) -> NDArray[np.bool_]:
        """Which places (N, 3) of the map get no signals."""
        covered = np.full(len(position), self.everywhere)
        for prism in self.prisms:
            covered |= prism.contains(position)
        return covered


NOWHERE = GnssDenial()
