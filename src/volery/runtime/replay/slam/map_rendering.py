"""Builds the map from scans at their final poses."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.mapping.log_odds import LogOddsGrid
from volery.autonomy.mapping.vertical_structures import VerticalStructures
from volery.autonomy.perception.static_transforms import Mount
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.errors import RecordingError
from volery.graph.messages import LaserScan, frame_of, stamp_of
from volery.runtime.replay.slam.offline_slam import SlamResult
from volery.runtime.replay.slam.trajectory import EstimatedTrajectory

_MIN_RANGE_M = 0.05
_MARGIN_M = 1.0
_MAX_CELLS = 100_000_000
_MAX_CELL_M = 2.0
"""Max cell width, m; a map that needs larger cells comes from a diverged trajectory."""
_SLAB_M = 0.5
"""Max height difference between a return and a tilted scanner, m; beyond it the return is of
other objects: ground, branches."""


_OVER_GROUND_M = 0.6
"""Max height above ground of returns that may be of the ground, m."""
_EVERY, _MIN_GROUND_RANGE_M, _MAX_GROUND_RANGE_M = 4, 0.6, 20.0
"""Beams of the nodding LIDAR that measure the ground: each fourth, between these ranges, m."""


def draw_map(outcome: SlamResult, cell_m: float, max_range_m: float) -> LogOddsGrid:
    """Returns the occupancy grid of a run; returns beyond `max_range_m` are free space up to there.

    Cells are `cell_m` wide, doubled as often as the memory limit requires. Raises
    `RecordingError` if that makes them too coarse.
    """
    ground = _ground(outcome)
    rays = [
        _rays(outcome.trajectory, row, scan, outcome.mount(frame_of(scan)), max_range_m, ground)
        for row, scan in outcome.scans
    ]
    ends = [np.concatenate([starts[:1], ends]) for starts, ends, _ in rays if len(starts)]
    spread = np.concatenate(ends) if ends else outcome.trajectory.position[:, :2]
    low, high = spread.min(axis=0) - _MARGIN_M, spread.max(axis=0) + _MARGIN_M
    grid = LogOddsGrid(low, high, fitting_cell(high - low, cell_m))
    for starts, ends_, hits in rays:
        grid.add(starts, ends_, hits)
    return grid


def fitting_cell(size: Array, cell_m: float) -> float:
    """Returns the cell width for a map of size (2,), m: `cell_m`, or a multiple that fits.

    Raises `RecordingError` if none fits.
    """
    wished = cell_m
    while np.isfinite(size).all() and cell_m <= max(_MAX_CELL_M, wished):
        if float(np.prod(size / cell_m)) <= _MAX_CELLS:
            return cell_m
        cell_m *= 2.0
    raise RecordingError(
        f"a map of {size[0]:.0f} m x {size[1]:.0f} m is too large: the trajectory diverged"
    )


def _rays(
    trajectory: EstimatedTrajectory,
    row: int,
    scan: LaserScan,
    mount: Mount,
    max_range_m: float,
    ground: VerticalStructures | None,
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Returns starts and ends (K, 2), m, of a scan's rays in the map, and whether they hit."""
    ranges = np.asarray(scan.ranges, np.float64)
    range_min = max(_MIN_RANGE_M, float(scan.range_min))
    range_max = float(scan.range_max)
    rows = np.flatnonzero(
        (ranges >= range_min) & (ranges <= (range_max if range_max > 0.0 else math.inf))
    )
    length = np.minimum(ranges[rows], max_range_m)
    hits = ranges[rows] <= max_range_m
    angle = float(scan.angle_min) + rows * float(scan.angle_increment)
    flat = np.stack([length * np.cos(angle), length * np.sin(angle), np.zeros(len(rows))], axis=1)
    position, turn = _poses(trajectory, row, scan, rows)
    starts = rotations.rotate(turn, mount.position) + position
    ends = rotations.rotate(rotations.multiply(turn, mount.attitude), flat) + starts
    rise = np.abs(ends[:, 2] - starts[:, 2])
    short = np.minimum(_SLAB_M / np.maximum(rise, 1e-9), 1.0)[:, None]
    ends = starts + short * (ends - starts)
    hits &= short[:, 0] >= 1.0
    if ground is not None:  # unmapped ground: the return may be of the ground
        hits[hits] = ground.heights_m(ends[hits]) > _OVER_GROUND_M
    return starts[:, :2], ends[:, :2], hits


def _ground(outcome: SlamResult) -> VerticalStructures | None:
    """Returns the ground measured by the nodding LIDAR; None without one."""
    if not outcome.nodding or not len(outcome.nods):
        return None
    found = [np.zeros((0, 3))]
    for row, scan in outcome.nodding:
        ranges = np.asarray(scan.ranges, np.float64)[::_EVERY]
        near = (ranges > _MIN_GROUND_RANGE_M) & (ranges < _MAX_GROUND_RANGE_M)
        length, beams = ranges[near], np.flatnonzero(near) * _EVERY
        when = stamp_of(scan) * 1e-9 + beams * float(scan.time_increment)
        nod = np.interp(when, outcome.nods[:, 0], outcome.nods[:, 1])
        angle = float(scan.angle_min) + beams * float(scan.angle_increment)
        x, y = length * np.cos(angle), length * np.sin(angle)
        along = np.stack([np.cos(nod) * x, y, -np.sin(nod) * x], axis=1)
        mount = outcome.mount(frame_of(scan))
        body = rotations.rotate(mount.attitude, along) + mount.position
        position, turn = _poses(outcome.trajectory, row, scan, beams)
        found.append(rotations.rotate(turn, body) + position)
    return VerticalStructures(np.concatenate(found))


def _poses(
    trajectory: EstimatedTrajectory, row: int, scan: LaserScan, beams: NDArray[np.int64]
) -> tuple[Array, Array]:
    """Returns the body's positions (K, 3), m, and attitudes (K, 4), x y z w, at each beam."""
    first = stamp_of(scan) - int(trajectory.time_ns[row]) + int(trajectory.clock_ns[row])
    when = first + beams * (float(scan.time_increment) * 1e9)
    clock = trajectory.clock_ns
    after = np.clip(np.searchsorted(clock, when, side="right"), 1, max(len(clock) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(clock) - 1)
    span = np.maximum(clock[after] - clock[before], 1)
    fraction = np.clip((when - clock[before]) / span, 0.0, 1.0)[:, None]
    position = (
        trajectory.position[before] * (1.0 - fraction) + trajectory.position[after] * fraction
    )
    one, other = trajectory.attitude[before], trajectory.attitude[after]
    sign = np.where((one * other).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    return position, rotations.normalize((1.0 - fraction) * one + fraction * sign * other)
