"""Sensors that repeat themselves: new stamps, old measurements.

Two measurements of a real sensor are never alike to the last bit: all have noise.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.scan_points import Pose
from volery.graph.messages import LaserScan

_MOVES_M_S = 0.1


class ScanRepeats:
    """Whether scans of one LIDAR are those that came before."""

    def __init__(self) -> None:
        self._ranges: NDArray[np.float32] = np.zeros(0, np.float32)

    def are_told_by(self, scan: LaserScan) -> bool:
        """Whether a scan has the ranges of the one before; one without any return never does."""
        ranges = np.asarray(scan.ranges, np.float32)
        before, self._ranges = self._ranges, ranges
        return (
            len(ranges) == len(before)
            and bool(np.isfinite(ranges).any())
            and np.array_equal(ranges, before, equal_nan=True)
        )


def is_stuck(pose: Pose, before: Pose | None) -> bool:
    """Whether odometry says that it moves, and yet that it is where it was, to the last bit."""
    return (
        before is not None
        and bool(np.linalg.norm(pose.velocity) > _MOVES_M_S)
        and np.array_equal(pose.position, before.position)
        and np.array_equal(pose.attitude, before.attitude)
    )
