"""LIDAR sweeps: motion-compensated returns in the current body frame."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.slam.inertial_kernels import P, Q
from volery.core.arrays import Array
from volery.core.compiled import kernel
from volery.core.rotation_kernels import rotate_vector

Times = NDArray[np.int64]


class Sweep(NamedTuple):
    """One scan of a planar LIDAR, and the angles of its mount."""

    name: str
    first_ns: int
    beam_ns: float
    angle_min: float
    angle_step: float
    ranges: NDArray[np.float32]
    mount: Array
    nod: float = 0.0
    last_nod: float = 0.0

    @property
    def last_ns(self) -> int:
        """Time of the last beam, ns."""
        return self.first_ns + round(self.beam_ns * (len(self.ranges) - 1))

    @property
    def nods(self) -> bool:
        """Whether its mount is not level."""
        return self.nod != 0.0 or self.last_nod != 0.0

    def points(self, nearest_m: float, max_range_m: float, times: Times, states: Array) -> Array:
        """Returns points (K, 3) between two ranges, m in the newest body frame; see `unskew`."""
        points = np.empty((len(self.ranges), 3))
        count = unskew(
            self.ranges, nearest_m, max_range_m, self.angle_min, self.angle_step, self.first_ns,
            self.beam_ns, self.nod, self.last_nod, self.mount, times, states, points,
        )  # fmt: skip
        return points[:count]


class SweepPoints(NamedTuple):
    """Returns of a sweep after the filter update."""

    points: Array
    """(K, 3) m in the frame of the odometry."""
    kinds: NDArray[np.int8]
    """(K,) kinds; see `matching_kernels`."""
    is_drawn: bool
    """Whether its uprights were inserted into the map."""


@kernel
def unskew(
    ranges: NDArray[np.float32],
    nearest: float,
    max_range: float,
    angle_min: float,
    angle_step: float,
    first_ns: int,
    beam_ns: float,
    nod: float,
    last_nod: float,
    mount: Array,
    times: Times,
    states: Array,
    points: Array,
) -> int:
    """Fills `points` (K, 3), m in the body at the newest of `states` (M, 19); returns their number.

    `times` (M,) increase; a beam's pose is interpolated between the two around its time. `nod` and
    `last_nod` are the mount's angles (rad, positive down) at the first and last beam.
    """
    now = states[len(times) - 1]
    last, count, row = max(len(ranges) - 1, 1), 0, 0
    for beam in range(len(ranges)):
        distance = ranges[beam]
        if not nearest <= distance <= max_range:  # leaves out nan
            continue
        moment = first_ns + beam * beam_ns
        while row < len(times) - 2 and times[row + 1] < moment:
            row += 1
        span = float(times[row + 1] - times[row])
        fraction = min(max((moment - times[row]) / span, 0.0), 1.0)
        angle = angle_min + beam * angle_step
        x, y = distance * math.cos(angle), distance * math.sin(angle)
        tilt = nod + beam / last * (last_nod - nod)
        bx, by, bz = math.cos(tilt) * x + mount[0], y + mount[1], -math.sin(tilt) * x + mount[2]
        one, two = states[row], states[row + 1]
        keep = 1.0 - fraction
        if (
            one[Q] * two[Q]
            + one[Q + 1] * two[Q + 1]
            + one[Q + 2] * two[Q + 2]
            + (one[Q + 3] * two[Q + 3])
            < 0.0
        ):
            fraction = -fraction
        qx, qy = keep * one[Q] + fraction * two[Q], keep * one[Q + 1] + fraction * two[Q + 1]
        qz, qw = (
            keep * one[Q + 2] + fraction * two[Q + 2],
            keep * one[Q + 3] + fraction * two[Q + 3],
        )
        norm = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
        wx, wy, wz = rotate_vector(qx * norm, qy * norm, qz * norm, qw * norm, bx, by, bz)
        fraction = abs(fraction)
        wx += keep * one[P] + fraction * two[P] - now[P]
        wy += keep * one[P + 1] + fraction * two[P + 1] - now[P + 1]
        wz += keep * one[P + 2] + fraction * two[P + 2] - now[P + 2]
        bx, by, bz = rotate_vector(-now[Q], -now[Q + 1], -now[Q + 2], now[Q + 3], wx, wy, wz)
        points[count, 0], points[count, 1], points[count, 2] = bx, by, bz
        count += 1
    return count
