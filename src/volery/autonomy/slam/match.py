"""How well a sweep fits the map, beside what is usual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.core.clock import NS_PER_S

Array = NDArray[np.float64]

MANY, MISFIT = 15.0, 0.25
"""Returns from which on their share says something, and how far below the usual one is too low.

Where much comes into sight for the first time the share falls to half of the usual one, where
nothing is as it was to a twentieth (recorded flights).
"""
_USUAL_S = 10.0
"""Time over which what is usual changes (modelling choices)."""


@dataclass
class Match:
    """What the newest sweep of a LIDAR said."""

    time_ns: int = 0
    met: float = 0.0
    """Uprights of the map that were met again, each by how well."""
    seen: float = 0.0
    """Returns that should have met one."""
    ground: float = 0.0
    usual: float = 0.0
    """Share of the returns that lately met something again."""

    @property
    def fits(self) -> bool:
        """Whether about as much is met again as is usual."""
        return self.seen < MANY or self.met >= MISFIT * self.usual * self.seen


def judged(told: Array, before: Match | None, time_ns: int) -> Match:
    """What a sweep said (`told`, see `matching_kernels.gather`), after the one before it."""
    found = Match(time_ns, float(told[0]), float(told[1]), float(told[2]))
    if before is not None:
        found.usual = before.usual
        if found.seen >= MANY and found.fits:
            passed = (time_ns - before.time_ns) / NS_PER_S
            share = found.met / found.seen
            found.usual += min(passed / _USUAL_S, 1.0) * (share - found.usual)
    return found
