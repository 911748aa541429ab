"""Quality of a sweep's fit to the map, relative to recent sweeps."""

from __future__ import annotations

from dataclasses import dataclass

from volery.core.arrays import Array
from volery.core.clock import NS_PER_S

MANY, MISFIT = 15.0, 0.25
"""Min number of returns for a check, and min matched fraction relative to the usual one.

In new surroundings the fraction falls to half of the usual one, after a kidnapping to a twentieth
(recorded flights).
"""
_USUAL_S = 10.0
"""Time constant of the usual fraction (modelling choices)."""


@dataclass
class Match:
    """Result of a LIDAR's newest sweep."""

    time_ns: int = 0
    met: float = 0.0
    """Matched uprights of the map, weighted by how well they fit."""
    seen: float = 0.0
    """Returns that should match an upright."""
    ground: float = 0.0
    usual: float = 0.0
    """Recent average of the matched fraction."""

    @property
    def fits(self) -> bool:
        """Whether the matched fraction is near the usual one."""
        return self.seen < MANY or self.met >= MISFIT * self.usual * self.seen


def judged(sums: Array, before: Match | None, time_ns: int) -> Match:
    """Returns the result of a sweep, after the previous one.

    `sums`: see `matching_kernels.gather`.
    """
    found = Match(time_ns, float(sums[0]), float(sums[1]), float(sums[2]))
    if before is not None:
        found.usual = before.usual
        if found.seen >= MANY and found.fits:
            passed = (time_ns - before.time_ns) / NS_PER_S
            fraction = found.met / found.seen
            found.usual += min(passed / _USUAL_S, 1.0) * (fraction - found.usual)
    return found
