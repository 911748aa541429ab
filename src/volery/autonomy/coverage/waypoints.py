"""Converts tours on the grid to waypoints in the map: transits, tours, the return."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.coverage.cells import CoverageCells
from volery.autonomy.coverage.field import CoverageField
from volery.autonomy.coverage.spanning_tree import CoverageTour
from volery.core.arrays import Array
from volery.core.errors import PlanError

_HIGHEST = 1e4


@dataclass(frozen=True)
class HeightProfile:
    """Heights in the map, m.

    cover: of the tours. layer: height difference between UAVs in transit, so that crossing transits
    are separated. over: at which blocked cells may be crossed, 0: never.
    """

    cover: float
    layer: float
    over: float

    def __post_init__(self) -> None:
        """Raises PlanError for heights out of range."""
        low = {"height_m": (self.cover, -_HIGHEST), "layer_spacing_m": (self.layer, 0.0)}
        for key, (height, minimum) in {**low, "crossing_height_m": (self.over, 0.0)}.items():
            if not minimum <= height <= _HIGHEST:
                raise PlanError(f"{key} must be {minimum:g} to {_HIGHEST:g} m, not {height:g}")

    def transit(self, uav: int, *, over: bool) -> float:
        """Returns the transit height of UAV number `uav`, over blocked cells or not."""
        return (self.over if over else self.cover) + (uav + 1) * self.layer


@dataclass(frozen=True)
class WaypointProgress:
    """Waypoints (K, 3) m, map, and whether the leg to each covers cells, (K,)."""

    positions: Array
    covering: NDArray[np.bool_]


def route_waypoints(
    field: CoverageField,
    passable: CoverageCells,
    heights: HeightProfile,
    uav: int,
    position_map: Array,
    home_map: Array,
    tours: Sequence[CoverageTour],
) -> WaypointProgress:
    """Returns the waypoints of one UAV: for each tour the transit and the tour, then the return.

    passable: the free cells of the field. position_map: (3,) m, current position. home_map: (3,) m,
    landing position.
    """
    positions: list[Array] = []
    covering: list[bool] = []
    at = position_map[:2]

    def add(points: Array, height: float, covers: bool) -> None:
        positions.append(np.column_stack([points, np.full(len(points), height)]))
        covering.extend([covers] * len(points))

    for each in tours:
        away = field.sub_centres(each.sub_cells) - at
        tour = each.begun_at(int(np.argmin(np.hypot(away[:, 0], away[:, 1]))))
        corners = field.sub_centres(np.vstack([tour.corners(), tour.sub_cells[-1:]]))
        for points, height in _transit(field, passable, heights, uav, at, corners[0]):
            add(points, height, False)
        add(corners, heights.cover, True)
        at = corners[-1]
    for points, height in _transit(field, passable, heights, uav, at, home_map[:2]):
        add(points, height, False)
    add(home_map[None, :2], heights.cover, False)
    return WaypointProgress(np.vstack(positions), np.array(covering))


def _transit(
    field: CoverageField,
    passable: CoverageCells,
    heights: HeightProfile,
    uav: int,
    start: Array,
    goal: Array,
) -> list[tuple[Array, float]]:
    """Returns points (K, 2) and heights of a transit; empty within a cell or to a neighbour.

    The UAV climbs vertically, flies through free cells or over all, and descends vertically.
    """
    cells = field.cells_at(np.stack([start, goal]))
    if int(np.abs(cells[0] - cells[1]).sum()) <= 1:
        return []
    numbers = [passable.number(row, column) for row, column in cells.tolist()]
    path = passable.path(numbers[0], numbers[1]) if min(numbers) >= 0 else []
    if not path and heights.over <= 0.0:
        return []
    height = heights.transit(uav, over=not path)
    between = (
        field.centres(_corners(passable.rows_and_columns()[path])) if path else np.empty((0, 2))
    )
    return [(np.vstack([start[None], between, goal[None]]), height)]


def _corners(path: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the cells (K, 2) of a path at which it turns, without its ends."""
    steps = np.diff(path, axis=0)
    turns = (steps[1:] != steps[:-1]).any(axis=1)
    corners: NDArray[np.int64] = path[1:-1][turns]
    return corners
