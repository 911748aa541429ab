"""The cells to visit as a graph: neighbours, components, distances.

Rows count from south to north and columns from west to east, as in nav_msgs/OccupancyGrid. Cells
that share a side are neighbours. Distances also cross corners, but never past the corner of an
excluded cell: so they connect the same cells as sides do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import kernel
from volery.core.errors import PlanError

Ints = NDArray[np.int32]
Mask = NDArray[np.bool_]

EAST, NORTH, WEST, SOUTH = 0, 1, 2, 3
"""Columns of `CoverageCells.neighbours`; NE, NW, SW and SE follow."""

MAX_MAP_CELLS = 4096 * 4096
"""Max map size, free and blocked cells together: its index takes 64 MiB. Modelling choice."""
MAX_CELLS = 1 << 18
"""Max number of cells to visit, as of 512 x 512 free ones: a plan takes seconds. Modelling
choice.
"""

_STRAIGHT, _DIAGONAL = 5, 7
_BUCKETS = _DIAGONAL + 1
FAR = np.float32(3.0e38)
"""Distance of unreachable cells."""


@dataclass(frozen=True)
class CoverageCells:
    """The n included cells of a grid, numbered row by row.

    shape: rows, columns of the grid. flat: (n,) row * columns + column. index: (rows * columns,)
    number of a cell, -1 for excluded ones. neighbours: (n, 8) numbers of the cells around, -1 for
    none.
    """

    shape: tuple[int, int]
    flat: Ints
    index: Ints
    neighbours: Ints

    def __len__(self) -> int:
        return len(self.flat)

    @classmethod
    def of(cls, mask: Mask) -> CoverageCells:
        """Returns the cells of `mask` (rows, columns). Raises PlanError if there are too many."""
        if mask.ndim != 2 or 0 in mask.shape:
            raise PlanError(f"a map must have rows and columns, not the shape {mask.shape}")
        if mask.size > MAX_MAP_CELLS:
            raise PlanError(
                f"the map has {mask.shape[1]} x {mask.shape[0]} cells; at most "
                f"{MAX_MAP_CELLS:,} (4096 x 4096) can be planned: increase the cell size"
            )
        count = int(np.count_nonzero(mask))
        if count > MAX_CELLS:
            raise PlanError(
                f"the map has {count:,} free cells; at most {MAX_CELLS:,} can be planned: "
                "increase the cell size"
            )
        flat = np.flatnonzero(mask).astype(np.int32)
        index = np.full(mask.size, -1, np.int32)
        index[flat] = np.arange(count, dtype=np.int32)
        neighbours = np.full((count, 8), -1, np.int32)
        _link(flat, index, mask.shape[0], mask.shape[1], neighbours)
        return cls(mask.shape, flat, index, neighbours)

    def number(self, row: int, column: int) -> int:
        """Returns the number of the cell at (row, column); -1 if it is excluded or outside."""
        rows, columns = self.shape
        inside = 0 <= row < rows and 0 <= column < columns
        return int(self.index[row * columns + column]) if inside else -1

    def part(self, numbers: Ints) -> CoverageCells:
        """Returns these cells alone, numbered in this order; `numbers` must ascend."""
        new_number = np.full(len(self) + 1, -1, np.int32)  # the last one maps "none", -1, to itself
        new_number[numbers] = np.arange(len(numbers), dtype=np.int32)
        flat = self.flat[numbers]
        index = np.full(len(self.index), -1, np.int32)
        index[flat] = new_number[numbers]
        return CoverageCells(self.shape, flat, index, new_number[self.neighbours[numbers]])

    def rows_and_columns(self) -> NDArray[np.int64]:
        """Returns row and column (n, 2)."""
        return np.stack(np.divmod(self.flat.astype(np.int64), self.shape[1]), axis=1)

    def components(self) -> tuple[Ints, int]:
        """Returns components (n,), numbered by their first cells, and the number of components."""
        labels = np.full(len(self), -1, np.int32)
        return labels, int(_label(self.neighbours, labels))

    def distances(self, sources: Ints | list[int]) -> NDArray[np.float32]:
        """Returns shortest distances (n,) to the nearest source, in cells; `FAR` for no path.

        Steps to the side count 1, across a corner 1.4, which is within 8 % of straight lines.
        """
        out = np.full(len(self), FAR, np.float32)
        _spread(self.neighbours, np.asarray(sources, np.int32), out)
        return out

    def path(self, start: int, goal: int) -> list[int]:
        """Returns the cells of a shortest path, both ends included; empty if there is none."""
        distance = self.distances([goal])
        if distance[start] == FAR:
            return []
        path = [start]
        while path[-1] != goal:
            around = self.neighbours[path[-1]]
            around = around[around >= 0]
            path.append(int(around[np.argmin(distance[around])]))
        return path


@kernel
def _link(flat: Ints, index: Ints, rows: int, columns: int, neighbours: Ints) -> None:
    for k in range(flat.shape[0]):
        row, column = flat[k] // columns, flat[k] % columns
        if column + 1 < columns:
            neighbours[k, EAST] = index[flat[k] + 1]
        if row + 1 < rows:
            neighbours[k, NORTH] = index[flat[k] + columns]
        if column > 0:
            neighbours[k, WEST] = index[flat[k] - 1]
        if row > 0:
            neighbours[k, SOUTH] = index[flat[k] - columns]
    for k in range(flat.shape[0]):
        for side in range(4):
            one, other = neighbours[k, side], neighbours[k, (side + 1) % 4]
            if one >= 0 and other >= 0:
                neighbours[k, 4 + side] = neighbours[one, (side + 1) % 4]


@kernel
def _label(neighbours: Ints, labels: Ints) -> int:
    queue = np.empty(labels.shape[0], np.int32)
    count = 0
    for first in range(labels.shape[0]):
        if labels[first] >= 0:
            continue
        labels[first] = count
        queue[0], head, tail = first, 0, 1
        while head < tail:
            k = queue[head]
            head += 1
            for side in range(4):
                other = neighbours[k, side]
                if other >= 0 and labels[other] < 0:
                    labels[other] = count
                    queue[tail] = other
                    tail += 1
        count += 1
    return count


@kernel
def _spread(neighbours: Ints, sources: Ints, out: Any) -> None:
    """Runs Dijkstra's algorithm by buckets (Dial 1969) on 5-7 chamfers (Borgefors 1986)."""
    count = neighbours.shape[0]
    far = np.iinfo(np.int32).max
    length = np.full(count, far, np.int32)
    following = np.full(_BUCKETS, -1, np.int32)  # heads of the buckets' lists
    entries = np.empty((8 * count + sources.shape[0] + 1, 2), np.int32)  # cell, next entry
    used = 0
    for s in range(sources.shape[0]):
        length[sources[s]] = 0
        entries[used, 0], entries[used, 1] = sources[s], following[0]
        following[0] = used
        used += 1
    now, empty = 0, 0
    while empty <= _BUCKETS:
        bucket = now % _BUCKETS
        entry = following[bucket]
        following[bucket] = -1
        empty = empty + 1 if entry < 0 else 0
        while entry >= 0:
            k, entry = entries[entry, 0], entries[entry, 1]
            if length[k] != now:
                continue
            for side in range(8):
                other = neighbours[k, side]
                if other < 0:
                    continue
                then = now + (_STRAIGHT if side < 4 else _DIAGONAL)
                if then < length[other]:
                    length[other] = then
                    entries[used, 0], entries[used, 1] = other, following[then % _BUCKETS]
                    following[then % _BUCKETS] = used
                    used += 1
        now += 1
    for k in range(count):
        if length[k] < far:
            out[k] = length[k] / _STRAIGHT
