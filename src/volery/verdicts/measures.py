"""Distances and areas of a flight, from its samples."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.results import FlightResult
from volery.world.scene import Scene

MAX_CLEARANCE_M = 10.0
"""Distance from obstacles beyond which it does not count, m."""
_LOOK_M = 4.0 * MAX_CLEARANCE_M
"""Distance up to which obstacles are searched: far from them, long paths are skipped."""
_CELL_M = 0.5


class NearestObstacle(NamedTuple):
    """The moment at which a UAV is nearest to trees and solids."""

    distance_m: float
    """Distance of the UAV's position less its radius, m, at most `MAX_CLEARANCE_M` less it."""
    uav: int
    """Number of the UAV in the flight; -1: no UAV was in the air."""
    sample: int
    """Number of the sample."""


class NearestPair(NamedTuple):
    """The moment at which two UAVs are nearest to each other."""

    distance_m: float
    """Distance of their positions less their radii, m; inf for one UAV."""
    uavs: tuple[int, int]
    """Numbers of the UAVs in the flight."""
    sample: int
    """Number of the sample."""


def nearest_obstacle(
    flight: FlightResult,
    scene: Scene,
    *,
    rows: NDArray[np.int64] | None = None,
    samples: NDArray[np.int64] | None = None,
    radius_m: Array | None = None,
) -> NearestObstacle:
    """Returns the moment at which a UAV is nearest to trees and solids.

    rows, samples: numbers of the UAVs and samples to look at; None: all. radius_m: (n,) radii of
    the flight's UAVs; None: 0. A sample is skipped if the path from an earlier one is too short to
    come nearer than the nearest so far.
    """
    rows = np.arange(len(flight)) if rows is None else rows
    samples = np.arange(len(flight.times_s)) if samples is None else samples
    radius = np.zeros(len(flight)) if radius_m is None else radius_m
    paths = [_SampledPath.of(flight, int(row), samples) for row in rows]
    paths = [path for path in paths if len(path.samples)]
    best = NearestObstacle(np.inf, -1, 0)
    while paths:
        points = np.ascontiguousarray([path.points[path.cursor] for path in paths])
        found = scene.clearance(points, _LOOK_M, include_terrain=False).distance
        radii = radius[[path.row for path in paths]]
        gaps = np.minimum(found, _LOOK_M) - radii
        counted = np.minimum(gaps, MAX_CLEARANCE_M - radii)
        k = int(np.argmin(counted))
        if counted[k] < best.distance_m:
            path = paths[k]
            best = NearestObstacle(float(counted[k]), path.row, int(path.samples[path.cursor]))
        for path, gap in zip(paths, gaps.tolist(), strict=True):
            path.advance(gap - best.distance_m)
        paths = [path for path in paths if path.cursor < len(path.samples)]
    return best


class _SampledPath:
    """The path of a UAV, and the sample up to which it is known to come no nearer."""

    def __init__(self, row: int, samples: NDArray[np.int64], points: Array) -> None:
        self.row, self.samples, self.points = row, samples, points
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        self._along = np.concatenate([[0.0], np.cumsum(steps)])
        self.cursor = 0

    @classmethod
    def of(cls, flight: FlightResult, row: int, samples: NDArray[np.int64]) -> _SampledPath:
        """Returns the path of a UAV through those samples at which it exists."""
        points = flight.position_map[row, samples]
        exists = np.isfinite(points).all(axis=1)
        return cls(row, samples[exists], points[exists])

    def advance(self, slack_m: float) -> None:
        """Passes to the next sample that may be nearer by `slack_m`."""
        reached = self._along[self.cursor] + slack_m
        after = int(np.searchsorted(self._along, reached, side="right"))
        self.cursor = max(after, self.cursor + 1)


def nearest_pair(
    flight: FlightResult,
    *,
    rows: NDArray[np.int64] | None = None,
    samples: NDArray[np.int64] | None = None,
    radius_m: Array | None = None,
) -> NearestPair:
    """Returns the moment at which one of `rows` is nearest to any other UAV of the flight.

    rows, samples: numbers of the UAVs and samples to look at; None: all. radius_m: (n,) radii of
    the flight's UAVs; None: 0.
    """
    samples = np.arange(len(flight.times_s)) if samples is None else samples
    radius = np.zeros(len(flight)) if radius_m is None else radius_m
    chosen = set(range(len(flight)) if rows is None else rows.tolist())
    position = flight.position_map[:, samples]
    best = NearestPair(np.inf, (0, 0), 0)
    for row in sorted(chosen):
        others = [k for k in range(len(flight)) if k > row or k not in chosen]
        if not others or not len(samples):
            continue
        apart = np.linalg.norm(position[others] - position[row], axis=2)
        gaps = np.where(np.isnan(apart), np.inf, apart) - (radius[others] + radius[row])[:, None]
        k, sample = np.unravel_index(int(np.argmin(gaps)), gaps.shape)
        if gaps[k, sample] < best.distance_m:
            pair = sorted((row, others[int(k)]))
            best = NearestPair(float(gaps[k, sample]), (pair[0], pair[1]), int(samples[sample]))
    return best


def area_m2(paths: Array, radius_m: float = 2.0) -> float:
    """Returns the ground area, m2, within `radius_m` of paths (n, T, 3), in cells of 0.5 m."""
    cells = np.unique(np.concatenate([_cells(path) for path in paths]), axis=0)
    if not len(cells):
        return 0.0
    radius_cells = int(np.ceil(radius_m / _CELL_M))
    offsets = np.stack(
        np.meshgrid(*[np.arange(-radius_cells, radius_cells + 1)] * 2), axis=-1
    ).reshape(-1, 2)
    offsets = offsets[np.linalg.norm(offsets, axis=1) * _CELL_M <= radius_m]
    low = cells.min(axis=0) - radius_cells
    size = cells.max(axis=0) + radius_cells + 1 - low
    covered = np.zeros(size, np.bool_)
    for offset in offsets:
        x, y = (cells + offset - low).T
        covered[x, y] = True
    return float(covered.sum()) * _CELL_M**2


def _cells(path: Array) -> Array:
    """Returns the cells (C, 2) under a path (T, 3), without gaps."""
    ground = path[np.isfinite(path).all(axis=1), :2]
    if len(ground) < 2:
        return np.floor(ground / _CELL_M).astype(np.int64)
    lengths = np.linalg.norm(np.diff(ground, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    wanted = np.arange(0.0, along[-1] + _CELL_M, _CELL_M / 2.0)
    dense = np.stack([np.interp(wanted, along, column) for column in ground.T], axis=1)
    return np.floor(dense / _CELL_M).astype(np.int64)
