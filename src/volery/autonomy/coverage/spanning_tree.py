"""A closed tour of each area: around a spanning tree of its cells, on a grid twice as fine.

Spanning-tree coverage (Gabriely and Rimon, "Spanning-tree based coverage of continuous areas by a
mobile robot", Ann. Math. Artif. Intell. 31, 2001): each cell has four sub-cells; a tour with the
tree on its left passes each sub-cell of the area once and returns to its start.

All edges have the same length, so any spanning tree is a minimum one; the choice determines the
number of turns. Four orders are tried: rows or columns first, joined at the one end or at the
other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.coverage.cells import EAST, NORTH, SOUTH, WEST, CoverageCells, Ints
from volery.core.compiled import inner_kernel, kernel

NUM_ORDERS = 4


@dataclass(frozen=True)
class CoverageTour:
    """A closed tour through every sub-cell of an area.

    sub_cells: (4 * cells, 2) row and column on the grid twice as fine; each is beside the previous
    one, the first beside the last. turns: corners of the tour, including its closing.
    """

    sub_cells: Ints
    turns: int

    def begun_at(self, number: int) -> CoverageTour:
        """Returns the same tour from its sub-cell `number` on."""
        return CoverageTour(np.roll(self.sub_cells, -number, axis=0), self.turns)

    def corners(self) -> Ints:
        """Returns the sub-cells (K, 2) where it turns, after its first one: the goals of a UAV."""
        path = self.sub_cells
        ahead = np.roll(path, -1, axis=0) - path
        behind = path - np.roll(path, 1, axis=0)
        turns = (ahead != behind).any(axis=1)
        turns[0] = True
        corners: Ints = path[turns]
        return corners


def tours(cells: CoverageCells, owner: Ints, starts: Ints) -> list[CoverageTour]:
    """Returns a tour of each area, from a sub-cell of its start, with the fewest turns of four.

    owner: (n,) the area of each cell, -1 for none; all areas connected. starts: (R,) a cell of
    each.
    """
    best: list[CoverageTour] = []
    trees = np.empty((NUM_ORDERS, len(cells)), np.uint8)
    for order in range(NUM_ORDERS):
        _span(cells.neighbours, owner, order, trees[order])
    sizes = np.bincount(owner + 1, minlength=len(starts) + 1)[1:]
    for r, start in enumerate(starts):
        found = []
        for order in range(NUM_ORDERS):
            path = np.empty((4 * sizes[r], 2), np.int32)
            turns = _walk_around(cells.flat, cells.index, trees[order], cells.shape[1], start, path)
            found.append(CoverageTour(path, int(turns)))
        best.append(min(found, key=lambda tour: tour.turns))
    return best


@kernel
def _span(neighbours: Ints, owner: Ints, order: int, tree: NDArray[np.uint8]) -> None:
    """Spans a tree over every area (Kruskal 1956): bit d of `tree[k]` for an edge to side d."""
    count = owner.shape[0]
    root = np.arange(count).astype(np.int32)
    tree[:] = 0
    along = EAST if order < 2 else NORTH
    backwards = order % 2 == 1
    for turn in range(2):
        side = along if turn == 0 else (NORTH if along == EAST else EAST)
        for i in range(count):
            k = count - 1 - i if backwards else i
            other = neighbours[k, side]
            if other < 0 or owner[other] != owner[k]:
                continue
            one, two = _root_of(root, k), _root_of(root, other)
            if one != two:
                root[one] = two
                tree[k] |= np.uint8(1 << side)
                tree[other] |= np.uint8(1 << (side + 2))


@inner_kernel
def _root_of(root: Ints, k: int) -> int:
    while root[k] != k:
        root[k] = root[root[k]]
        k = root[k]
    return k


@kernel
def _walk_around(
    flat: Ints, index: Ints, tree: NDArray[np.uint8], columns: int, start: int, path: Ints
) -> int:
    """Fills `path` with the tour from the south-west sub-cell of `start`; returns its turns."""
    row, column = 2 * (flat[start] // columns), 2 * (flat[start] % columns)
    heading, turns, first = -1, 0, -1
    for i in range(path.shape[0]):
        path[i, 0], path[i, 1] = row, column
        k = index[(row // 2) * columns + column // 2]
        side = _side_ahead(row % 2, column % 2, tree[k])
        if heading < 0:
            first = side
        elif side != heading:
            turns += 1
        heading = side
        if side == EAST:
            column += 1
        elif side == NORTH:
            row += 1
        elif side == WEST:
            column -= 1
        else:
            row -= 1
    return turns + (1 if first != heading else 0)


@inner_kernel
def _side_ahead(north: int, east: int, edges: Any) -> int:
    """Returns the next side of a sub-cell: along the tree, else around the cell's centre."""
    if north == 0 and east == 0:
        return SOUTH if edges & (1 << SOUTH) else EAST
    if north == 0:
        return EAST if edges & (1 << EAST) else NORTH
    if east == 1:
        return NORTH if edges & (1 << NORTH) else WEST
    return WEST if edges & (1 << WEST) else SOUTH
