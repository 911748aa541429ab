"""Detects stuck sensors: new stamps with old measurements.

Two measurements of a real sensor are never equal to the last bit: all have noise. Those of a sonar
are whole centimetres, so many in a row must be equal.
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
"""Equal ranges in a row: with noise of 1 cm this happens by chance in some hundred hours."""


class ScanRepeats:
    """Detects repeated scans of one LIDAR."""

    def __init__(self) -> None:
        self._ranges: Ranges = np.zeros(0, np.float32)

    def are_reported_by(self, scan: LaserScan) -> bool:
        """Returns whether a scan with returns repeats the ranges of the previous one."""
        ranges = np.asarray(scan.ranges, np.float32)
        before, self._ranges = self._ranges, ranges
        return len(ranges) == len(before) and bool(_repeat(ranges, before))


class RangeRepeats:
    """Detects a sonar that repeats the same range."""

    def __init__(self) -> None:
        self._last = -1.0
        self._count = 0

    def are_reported_by(self, distance: float) -> bool:
        """Returns whether a range (m, finite) is the last of many equal ones."""
        self._count = self._count + 1 if distance == self._last else 1
        self._last = distance
        return self._count >= _ALIKE


def is_stuck(pose: OdometrySample, before: OdometrySample | None) -> bool:
    """Returns whether odometry has a velocity, but the same pose as before to the last bit."""
    return (
        before is not None
        and bool(norm(pose.velocity) > _MOVES_M_S)
        and pose.position.tolist() == before.position.tolist()
        and pose.attitude.tolist() == before.attitude.tolist()
    )


@brief_kernel
def _repeat(ranges: Ranges, before: Ranges) -> bool:
    """Returns whether all are equal, NaN included, and at least one is finite."""
    has_return = False
    for k in range(len(ranges)):
        one, other = ranges[k], before[k]
        if one != other and not (math.isnan(one) and math.isnan(other)):
            return False
        has_return = has_return or math.isfinite(one)
    return has_return
