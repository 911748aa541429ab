"""Regions in which satellite signals are denied: everywhere, or prisms over parts of the map."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array


class Prism(NamedTuple):
    """A polygon of the map, between a minimum and a maximum z in m."""

    corners: Array
    """(C, 2) m, in order around; the last corner connects to the first."""
    lowest: float = -math.inf
    highest: float = math.inf

    def contains(self, position: Array) -> NDArray[np.bool_]:
        """Returns (N,) whether positions (N, 3) m lie in the prism, by the even-odd rule."""
        x, y, z = position.T
        inside = np.zeros(len(position), np.bool_)
        for (ax, ay), (bx, by) in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            crosses = (ay > y) != (by > y)
            if ay != by:
                inside ^= crosses & (x < ax + (y - ay) * (bx - ax) / (by - ay))
        return np.asarray(inside & (self.lowest <= z) & (z <= self.highest))


class GnssDenial(NamedTuple):
    """All denied regions of a scenario."""

    everywhere: bool = False
    prisms: tuple[Prism, ...] = ()

    def covers(self, position: Array) -> NDArray[np.bool_]:
        """Returns (N,) whether positions (N, 3) m of the map receive no signals."""
        covered = np.full(len(position), self.everywhere)
        for prism in self.prisms:
            covered |= prism.contains(position)
        return covered


NOWHERE = GnssDenial()
