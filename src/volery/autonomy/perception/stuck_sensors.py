"""Sensors that repeat themselves: new stamps, old measurements.

Two measurements of a real sensor are never alike to the last bit: all have noise. Those of a sonar
are whole centimetres, so that many in a row must be alike.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.scan_points import OdometrySample
from volery.core.compiled import brief_kernel
from volery.core.vectors import norm
from volery.graph.messages import LaserScan

Ranges = NDArray[np.float32]

_MOVES_M_S = 0.1
_ALIKE = 15
"""Ranges in a row: with noise of 1 cm it takes some hundred hours until that comes by chance."""


class ScanRepeats:
    """Whether scans of one LIDAR are those that came before."""

    def __init__(self) -> None:
        self._ranges: Ranges = np.zeros(0, np.float32)

    def are_told_by(self, scan: LaserScan) -> bool:
        """Whether a scan has the ranges of the one before; one without any return never does."""
        ranges = np.asarray(scan.ranges, np.float32)
        before, self._ranges = self._ranges, ranges
        return len(ranges) == len(before) and bool(_repeat(ranges, before))


class RangeRepeats:
    """Whether a sonar goes on telling the same range."""

    def __init__(self) -> None:
        self._last = -1.0
        self._count = 0

    def are_told_by(self, distance: float) -> bool:
        """Whether a range (m, finite) is the last of many that are alike."""
        self._count = self._count + 1 if distance == self._last else 1
        self._last = distance
        return self._count >= _ALIKE


def is_stuck(pose: OdometrySample, before: OdometrySample | None) -> bool:
    """Whether odometry says that it moves, and yet that it is where it was, to the last bit."""
    return (
        before is not None
        and bool(norm(pose.velocity) > _MOVES_M_S)
        and pose.position.tolist() == before.position.tolist()
        and pose.attitude.tolist() == before.attitude.tolist()
    )


@brief_kernel
def _repeat(ranges: Ranges, before: Ranges) -> bool:
    """Whether all are the same, NaN and NaN, too, and one of them is finite."""
    has_return = False
    for k in range(len(ranges)):
        one, other = ranges[k], before[k]
        if one != other and not (math.isnan(one) and math.isnan(other)):
            return False
        has_return = has_return or math.isfinite(one)
    return has_return
