"""Assigns disconnected parts to UAVs, and computes how many cells each UAV gets.

UAVs share the part that they are in. A part without a UAV is visited as a whole by the nearest UAV,
which gets fewer cells of its own part in exchange, as far as possible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.coverage.cells import FAR, CoverageCells, Ints, Mask


@dataclass(frozen=True)
class CoverageVisit:
    """A part that one UAV visits as a whole: the UAV, the part, the first cell."""

    uav: int
    part: int
    entry: int


@dataclass(frozen=True)
class AreaShares:
    """Assignment of UAVs to parts.

    entries: (R,) the cell in which each UAV begins, -1 for one without work. visits: parts without
    a UAV, in the order of their visits. lost: numbers of unreachable parts.
    """

    entries: Ints
    visits: tuple[CoverageVisit, ...]
    lost: Ints


@dataclass(frozen=True)
class ReachableCells:
    """Distances of UAVs to the cells to visit.

    passable: the cells through which they fly, which include those to visit. flies_over: whether
    they may also cross blocked cells in a straight line.
    """

    passable: CoverageCells
    to_visit: CoverageCells
    flies_over: bool

    def of(self, start: int) -> NDArray[np.float32]:
        """Returns distances (n,) from cell `start` of `passable`, in cells; `FAR` for no path."""
        along = self.passable.distances([start])[self.passable.index[self.to_visit.flat]]
        if self.flies_over:
            rows, columns = np.divmod(self.to_visit.flat, self.to_visit.shape[1])
            row, column = divmod(int(self.passable.flat[start]), self.passable.shape[1])
            straight = np.hypot(rows - row, columns - column).astype(np.float32)
            along = np.where(along == FAR, straight, along)
        return along


def share_parts(reachable: ReachableCells, starts: Ints, labels: Ints, parts: int) -> AreaShares:
    """Assigns an entry cell to every UAV and a UAV to every part.

    starts: (R,) cells of `reachable.passable`. labels: (n,) part of each cell to visit. A UAV in a
    cell to visit begins there, any other in the nearest cell where no UAV begins.
    """
    count = len(reachable.to_visit)
    entries = reachable.to_visit.index[reachable.passable.flat[starts]].copy()
    taken = np.zeros(count, np.bool_)
    taken[entries[entries >= 0]] = True
    nearest = np.full(parts, FAR, np.float32)
    uav_of, entry_of = np.full(parts, -1, np.int32), np.full(parts, -1, np.int32)
    by_part = np.argsort(labels, kind="stable")
    firsts = np.searchsorted(labels[by_part], np.arange(parts))
    for uav, start in enumerate(starts):
        away = reachable.of(int(start))
        if entries[uav] < 0:
            free = np.where(taken, FAR, away)
            best = int(np.argmin(free)) if count else -1
            if best >= 0 and free[best] < FAR:
                entries[uav] = best
                taken[best] = True
        smallest = np.minimum.reduceat(away[by_part], firsts) if parts else nearest
        closer = smallest < nearest
        if closer.any():
            nearest[closer], uav_of[closer] = smallest[closer], uav
            entry_of[closer] = _entries(away, labels, smallest, closer)
    lived_in = np.unique(labels[entries[entries >= 0]])
    empty = np.setdiff1d(np.arange(parts, dtype=np.int32), lived_in)
    reached = empty[uav_of[empty] >= 0]
    order = reached[np.argsort(nearest[reached], kind="stable")]
    visits = tuple(CoverageVisit(int(uav_of[p]), int(p), int(entry_of[p])) for p in order)
    return AreaShares(entries, visits, empty[uav_of[empty] < 0])


def _entries(
    away: NDArray[np.float32], labels: Ints, smallest: NDArray[np.float32], wanted: Mask
) -> Ints:
    """Returns the first cell of each wanted part at the part's min distance."""
    at_least = np.flatnonzero((away == smallest[labels]) & wanted[labels]).astype(np.int32)
    _, first = np.unique(labels[at_least], return_index=True)
    found: Ints = at_least[first]
    return found


def level_shares(cells: int, carried: NDArray[np.int64]) -> NDArray[np.int64]:
    """Returns the numbers of cells (R,) that make the UAVs' loads as equal as possible.

    cells: the cells to divide. carried: (R,) cells that they visit elsewhere. Each gets at least
    one; those with the same load differ by one at most, the first ones getting more.
    """
    robots = len(carried)
    order = np.argsort(carried, kind="stable")
    load = carried[order] + 1
    left = cells - robots
    for raised in range(robots, 0, -1):
        level, more = divmod(int(load[:raised].sum()) + left, raised)
        if level >= load[raised - 1]:
            break
    given = np.ones(robots, np.int64)
    given[order[:raised]] += level - load[:raised]
    given[np.sort(order[:raised])[:more]] += 1
    return given
