"""Makes areas connected: disconnected parts go to adjacent areas."""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.autonomy.coverage.cells import Ints
from volery.core.compiled import inner_kernel, kernel


@kernel
def join_parts(neighbours: Ints, starts: Ints, targets: Any, owner: Ints) -> None:
    """Gives parts that are disconnected from their start to adjacent areas.

    An area grows into them by one ring of cells at a time, the one with the largest deficit first.
    """
    count, robots = owner.shape[0], starts.shape[0]
    queue = np.empty(count, np.int32)
    kept = np.zeros(count, np.bool_)
    sizes = np.zeros(robots, np.int64)
    for r in range(robots):
        sizes[r] = walk_part(neighbours, owner, starts[r], queue, kept)
    loose = count - sizes.sum()
    stuck = np.zeros(robots, np.bool_)
    while loose:
        grower = -1
        for r in range(robots):
            if not stuck[r] and (
                grower < 0 or sizes[r] - targets[r] < sizes[grower] - targets[grower]
            ):
                grower = r
        if grower < 0:
            return  # cells are one component, so none is loose when all are stuck
        tail = _ring_around(neighbours, owner, kept, grower, queue)
        for i in range(tail):
            owner[queue[i]] = grower
            kept[queue[i]] = True
        sizes[grower] += tail
        loose -= tail
        stuck[grower] = tail == 0
        if tail:
            stuck[:] = False


@inner_kernel
def walk_part(neighbours: Ints, owner: Ints, start: int, queue: Ints, seen: Any) -> int:
    """Marks the cells of an area that are connected to its start; returns their number.

    Cells that `seen` already marks are excluded.
    """
    area = owner[start]
    seen[start] = True
    queue[0] = start
    head, tail = 0, 1
    while head < tail:
        k = queue[head]
        head += 1
        for side in range(4):
            other = neighbours[k, side]
            if other >= 0 and owner[other] == area and not seen[other]:
                seen[other] = True
                queue[tail] = other
                tail += 1
    return tail


@inner_kernel
def _ring_around(neighbours: Ints, owner: Ints, kept: Any, grower: int, ring: Ints) -> int:
    """Fills `ring` with the loose cells beside an area; returns their number."""
    found = 0
    for k in range(owner.shape[0]):
        if kept[k]:
            continue
        for side in range(4):
            other = neighbours[k, side]
            if other >= 0 and kept[other] and owner[other] == grower:
                ring[found] = k
                found += 1
                break
    return found
