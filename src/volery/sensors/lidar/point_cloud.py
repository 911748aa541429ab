"""Points for PointCloud2 from echoes: packed x y z intensity ring time.

The layout is that of the Velodyne driver's cloud with ring and time (22 bytes per point), which
LIO-SAM, FAST-LIO and other deskewing tools read by field name. Clouds are unorganized and dense:
beams without an echo are left out, and points are ordered by time, column by column.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import kernel
from volery.sensors.samples import LidarScans

POINT = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("intensity", "<f4"),
        ("ring", "<u2"),
        ("time", "<f4"),
    ]
)
"""Fields of a point: x y z in m, in the sensor frame at the point's own time; `time` in s after the
stamp."""


class PointMaker:
    """Makes the points of a batch of scans; data that all its sensors share is computed once."""

    def __init__(self, scans: LidarScans) -> None:
        pattern = scans.model.scan
        self._scans = scans
        self._direction = pattern.directions(scans.number)
        self._ring = pattern.ring
        self._time_s = pattern.time_s

    def points(self, row: int) -> NDArray[Any]:
        """Returns a new, read-only array (N,) of POINT with the points of sensor `row`.

        Echoes of a beam are adjacent; without intensities in the scans these are 0.
        """
        echoes = self._scans.echoes[row]
        points = np.empty(echoes.size, dtype=POINT)
        count = _fill(
            self._direction,
            self._ring,
            self._time_s,
            echoes,
            self._scans.intensities[row],
            points,
        )
        points = points[:count]
        points.flags.writeable = False
        return points


@kernel
def _fill(
    direction: NDArray[np.float64],
    ring: NDArray[np.uint16],
    time_s: NDArray[np.float32],
    echoes: NDArray[np.float32],
    intensities: NDArray[np.float32],
    points: NDArray[Any],
) -> int:
    """Writes the echoes (E, beams) of one scan as points; returns their number."""
    count = 0
    for i in range(echoes.shape[1]):
        for e in range(echoes.shape[0]):
            r = echoes[e, i]
            if not abs(r) < np.inf:
                continue
            point = points[count]
            point.x = r * direction[0, i]
            point.y = r * direction[1, i]
            point.z = r * direction[2, i]
            point.intensity = intensities[e, i] if intensities.shape[0] > 0 else 0.0
            point.ring = ring[i]
            point.time = time_s[i]
            count += 1
    return count
