"""Converts laser scans to rays in the odometry frame, each beam from its pose.

A ray holds more information than a return: all along it the space is free. A beam without a return
(`inf`, REP-117) may have hit nothing, or a surface that reflects too little; it frees a shorter
distance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.motion_history import MotionHistory, NodHistory, Pose
from volery.core.arrays import Array
from volery.core.clock import ns_from_s
from volery.core.compiled import brief_kernel, kernel
from volery.core.rotation_kernels import rotate_vector
from volery.graph.messages import LaserScan, stamp_of


class Rays(NamedTuple):
    """Rays of one scan, m, all in one frame."""

    starts: Array
    """(K, 3)."""
    ends: Array
    """(K, 3)."""
    hits: NDArray[np.bool_]
    """(K,): whether the ray ends at an obstacle, or the space is free up to its end."""


class Beams(NamedTuple):
    """Selection and ranges of a LIDAR's beams."""

    max_range_m: float = 15.0
    """Max range; beyond it returns count as free space up to it."""
    nearest_m: float = 0.45
    """Min range; nearer returns are from the vehicle itself, or noise."""
    blank_m: float = 5.0
    """Free distance of a beam without a return (modelling choice)."""
    every: int = 1
    """Step between used beams."""


class RayMaker:
    """Converts scans of one LIDAR at `mount` (3,) m in the body, its axes along the body's."""

    def __init__(self, mount: Sequence[float], beams: Beams) -> None:
        self._mount = np.array(mount, dtype=np.float64)
        self._beams = beams

    def rays(self, scan: LaserScan, motion: MotionHistory, nod: NodHistory | None) -> Rays | None:
        """Returns the rays of a scan; None if it has no beams or its motion is unknown.

        `nod` is the mount's, None for a fixed one.
        """
        first, last = scan_times(scan)
        tilt = (0.0, 0.0) if nod is None else (nod.at(first), nod.at(last))
        poses = (motion.at(first), motion.at(last))
        if tilt[0] is None or tilt[1] is None or poses[0] is None or poses[1] is None:
            return None
        if not is_usable(scan):
            return None
        return self._cast(scan, poses[0], poses[1], tilt[0], tilt[1])

    def _cast(
        self, scan: LaserScan, first: Pose, last: Pose, tilt: float, last_tilt: float
    ) -> Rays:
        ranges = np.asarray(scan.ranges, dtype=np.float32)
        max_rays = len(ranges) // self._beams.every + 1
        starts, ends, hits = (
            np.empty((max_rays, 3)),
            np.empty((max_rays, 3)),
            np.empty(max_rays, np.bool_),
        )
        turned = last.attitude * (1.0 if first.attitude @ last.attitude >= 0.0 else -1.0)
        count = _cast(
            ranges,
            self._beams.every,
            self._beams.nearest_m,
            min(self._beams.max_range_m, float(scan.range_max)),
            self._beams.blank_m,
            float(scan.angle_min),
            float(scan.angle_increment),
            tilt,
            last_tilt,
            self._mount,
            first.position,
            last.position,
            first.attitude,
            turned,
            starts,
            ends,
            hits,
        )
        return Rays(starts[:count], ends[:count], hits[:count])


def scan_times(scan: LaserScan) -> tuple[int, int]:
    """Returns the times of the first and the last beam, ns."""
    first = stamp_of(scan)
    sweep = float(scan.time_increment) * max(len(scan.ranges) - 1, 0)
    return first, first + (ns_from_s(sweep) if math.isfinite(sweep) else 0)


def is_usable(scan: LaserScan) -> bool:
    """Returns whether a scan has beams and finite angles."""
    numbers = (scan.angle_min, scan.angle_increment, scan.time_increment, scan.range_max)
    return len(scan.ranges) > 0 and all(math.isfinite(number) for number in numbers)


def has_return(scan: LaserScan) -> bool:
    """Returns whether any beam of a scan has a return."""
    return bool(_is_any_finite(np.asarray(scan.ranges, np.float32)))


@brief_kernel
def _is_any_finite(ranges: NDArray[np.float32]) -> bool:
    for distance in ranges:  # noqa: SIM110  numba knows no generators here
        if math.isfinite(distance):
            return True
    return False


@kernel
def _cast(
    ranges: NDArray[np.float32],
    every: int,
    nearest: float,
    max_range: float,
    blank: float,
    angle_min: float,
    angle_increment: float,
    tilt: float,
    last_tilt: float,
    mount: Array,
    position: Array,
    last_position: Array,
    attitude: Array,
    last_attitude: Array,
    starts: Array,
    ends: Array,
    hits: NDArray[np.bool_],
) -> int:
    """Fills `starts`, `ends` and `hits`, returns their number. Comparisons exclude nan."""
    count = 0
    last = max(len(ranges) - 1, 1)
    for beam in range(0, len(ranges), every):
        distance = ranges[beam]
        hit = nearest <= distance <= max_range
        if hit:
            length = float(distance)
        elif distance == math.inf:
            length = min(blank, max_range)
        elif distance > max_range:
            length = max_range
        else:
            continue
        fraction = beam / last
        nod = tilt + fraction * (last_tilt - tilt)
        angle = angle_min + beam * angle_increment
        x, y = length * math.cos(angle), length * math.sin(angle)
        qx = attitude[0] + fraction * (last_attitude[0] - attitude[0])
        qy = attitude[1] + fraction * (last_attitude[1] - attitude[1])
        qz = attitude[2] + fraction * (last_attitude[2] - attitude[2])
        qw = attitude[3] + fraction * (last_attitude[3] - attitude[3])
        k = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
        sx, sy, sz = rotate_vector(qx * k, qy * k, qz * k, qw * k, mount[0], mount[1], mount[2])
        ex, ey, ez = rotate_vector(
            qx * k, qy * k, qz * k, qw * k, math.cos(nod) * x, y, -math.sin(nod) * x
        )
        sx += position[0] + fraction * (last_position[0] - position[0])
        sy += position[1] + fraction * (last_position[1] - position[1])
        sz += position[2] + fraction * (last_position[2] - position[2])
        starts[count, 0], starts[count, 1], starts[count, 2] = sx, sy, sz
        ends[count, 0], ends[count, 1], ends[count, 2] = sx + ex, sy + ey, sz + ez
        hits[count] = hit
        count += 1
    return count
