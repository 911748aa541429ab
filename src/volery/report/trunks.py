"""Detects trunk candidates in level scans, and maps them.

A trunk is a short run of beams that is nearer than its neighbours and a few centimetres to a metre
wide. It is modelled as a circle whose visible width is its diameter. The map serves to check poses;
it is no mapping method of its own. Crowns and the ground can look the same in one scan;
`trunk_survey` distinguishes them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array

_NEAREST_M, _MAX_RANGE_M = 0.6, 15.0
_APART_M = 0.35
"""Range difference of neighbouring beams above which they hit different objects."""
_STANDS_OUT_M = 0.6
"""Min range difference between a trunk and its neighbours."""
_MIN_BEAMS = 4
_NARROWEST_M, _WIDEST_M = 0.06, 1.2
_SAME_M = 0.8
"""Distance within which two detections are of one trunk. All modelling choices."""
_SEEN_OFTEN = 3


def trunks_of_scan(ranges: NDArray[np.floating], angle_min: float, increment: float) -> Array:
    """Returns candidates (K, 3): centre x, y in the scanner's frame, m, and index of the beam."""
    r = np.asarray(ranges, np.float64)
    r = np.where(np.isfinite(r) & (r > _NEAREST_M), r, np.inf)
    near = np.minimum(r, 2.0 * _MAX_RANGE_M)
    starts = np.flatnonzero(np.abs(np.diff(near)) > _APART_M) + 1
    found = []
    for first, end in pairwise(starts):
        part = near[first:end]
        if end - first < _MIN_BEAMS or part.max() > _MAX_RANGE_M:
            continue
        wide = float(part.mean()) * (end - first) * increment
        stands_out = min(near[first - 1] - part[0], near[end] - part[-1]) > _STANDS_OUT_M
        if stands_out and _NARROWEST_M < wide < _WIDEST_M:
            beam = 0.5 * (first + end - 1)
            angle = angle_min + beam * increment
            away = float(part.min()) + 0.5 * wide
            found.append((away * np.cos(angle), away * np.sin(angle), beam))
    return np.array(found).reshape(-1, 3)


@dataclass
class TrunkMap:
    """Trunks, each the mean of its detections."""

    positions: Array = field(default_factory=lambda: np.zeros((0, 3)))
    """(T, 3) m, map, at the height of detection."""
    sightings: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """(T,) numbers of detections."""

    @property
    def seen_often(self) -> Array:
        """(S, 3) m, trunks detected three times or more."""
        return self.positions[self.sightings >= _SEEN_OFTEN]

    def add(self, seen: Array) -> None:
        """Adds the trunks (K, 3) of one scan."""
        for position in seen:
            away = np.hypot(*(self.positions - position)[:, :2].T)
            if len(away) and away.min() <= _SAME_M:
                k = int(np.argmin(away))
                self.sightings[k] += 1
                self.positions[k] += (position - self.positions[k]) / self.sightings[k]
            else:
                self.positions = np.concatenate([self.positions, position[None]])
                self.sightings = np.append(self.sightings, 1)
