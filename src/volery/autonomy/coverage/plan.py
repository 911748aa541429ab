"""The plan of a coverage flight: the cells of each UAV, and their order.

    plan = plan_coverage(free, starts)
    plan.owner          # (rows, columns) UAV of each cell
    plan.routes[0]      # the tours of the first UAV

Steps: the cells to visit fall into parts (`components`); UAVs of one part divide it among them
(`darp`); each area gets a closed tour (`spanning_tree`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.autonomy.coverage.cells import CoverageCells, Ints, Mask
from volery.autonomy.coverage.components import (
    AreaShares,
    ReachableCells,
    level_shares,
    share_parts,
)
from volery.autonomy.coverage.darp import divide
from volery.autonomy.coverage.spanning_tree import CoverageTour, tours
from volery.core.errors import PlanError
from volery.core.plurals import counted

NOT_TO_VISIT = -2
"""Owner of cells that are blocked, or that need no visit."""
UNREACHABLE = -1
"""Owner of cells to visit that no UAV can reach."""

MAX_FIELD_NUMBERS = 1 << 24
"""Max cells times UAVs in one part: 128 MiB for their fields. Modelling choice."""


@dataclass(frozen=True)
class CoveragePlan:
    """Assignment and tours of a coverage flight.

    owner: (rows, columns) number of the UAV, `UNREACHABLE` or `NOT_TO_VISIT`. routes: the
    successive tours of each UAV, the one around its start first; empty for a UAV without work.
    spread: largest difference between the cells of UAVs that divide a part.
    """

    owner: NDArray[np.int16]
    routes: tuple[tuple[CoverageTour, ...], ...]
    spread: int

    @property
    def shares(self) -> NDArray[np.int64]:
        """Numbers of cells (R,) of the UAVs."""
        return np.bincount(self.owner[self.owner >= 0], minlength=len(self.routes))

    @property
    def unreachable(self) -> int:
        """Number of unreachable cells."""
        return int(np.count_nonzero(self.owner == UNREACHABLE))


def plan_coverage(
    free: Mask,
    starts: ArrayLike,
    *,
    to_visit: Mask | None = None,
    flies_over: bool = False,
    seed: int = 1,
) -> CoveragePlan:
    """Divides a grid map among UAVs and plans a closed tour through each area.

    free: (rows, columns) cells where a UAV may fly at its height. starts: (R, 2) row and column of
    each UAV; free and distinct. to_visit: the free cells that need a visit; None: all of them.
    flies_over: whether a UAV may cross blocked cells, above them, to reach other parts. seed: of
    the method's random numbers; the same seed gives the same plan.

    Raises
    ------
    PlanError
        A start is blocked, outside or not unique; no cell is free; map or fleet are too large.

    """
    passable = CoverageCells.of(np.asarray(free, np.bool_))
    begin = _checked_starts(passable, np.asarray(starts))
    cells = (
        passable if to_visit is None else CoverageCells.of(np.asarray(to_visit, np.bool_) & free)
    )
    labels, parts = cells.components()
    shares = share_parts(ReachableCells(passable, cells, flies_over), begin, labels, parts)
    areas = np.full(len(cells), UNREACHABLE, np.int32)
    spread = _divide_parts(cells, labels, shares, areas, seed)
    routes = _routes(cells, labels, shares, areas)
    owner = np.full(cells.shape[0] * cells.shape[1], NOT_TO_VISIT, np.int16)
    owner[cells.flat] = areas
    return CoveragePlan(owner.reshape(cells.shape), routes, spread)


def _checked_starts(passable: CoverageCells, starts: NDArray[np.int64]) -> Ints:
    """Returns the numbers of the start cells."""
    if starts.ndim != 2 or starts.shape[1] != 2 or not len(starts):
        raise PlanError("starts must be an array (R, 2) of rows and columns for at least one UAV")
    if not len(passable):
        raise PlanError("the map has no free cell")
    numbers = np.empty(len(starts), np.int32)
    seen: dict[int, int] = {}
    for uav, (row, column) in enumerate(starts.tolist()):
        number = passable.number(row, column)
        if number < 0:
            inside = 0 <= row < passable.shape[0] and 0 <= column < passable.shape[1]
            why = "is blocked" if inside else "lies outside the map"
            raise PlanError(f"UAV {uav + 1} starts in row {row}, column {column}, which {why}")
        if number in seen:
            raise PlanError(
                f"UAVs {seen[number] + 1} and {uav + 1} both start in row {row}, column {column}; "
                "each needs a cell of its own"
            )
        seen[number] = uav
        numbers[uav] = number
    return numbers


def _divide_parts(
    cells: CoverageCells, labels: Ints, shares: AreaShares, areas: Ints, seed: int
) -> int:
    """Sets `areas` (n,) to the UAV of each cell; returns the largest difference in a part."""
    carried = np.zeros(len(shares.entries), np.int64)
    sizes = np.bincount(labels, minlength=1)
    owner_of_part = np.full(len(sizes), UNREACHABLE, np.int32)
    for visit in shares.visits:
        owner_of_part[visit.part] = visit.uav
        carried[visit.uav] += sizes[visit.part]
    areas[:] = owner_of_part[labels]
    working = np.flatnonzero(shares.entries >= 0)
    homes = labels[shares.entries[working]]
    spread = 0
    for part in np.unique(homes):
        uavs = working[homes == part]
        if len(uavs) * int(sizes[part]) > MAX_FIELD_NUMBERS:
            raise PlanError(
                f"{counted(len(uavs), 'UAV')} for {sizes[part]:,} cells; their product may be "
                f"{MAX_FIELD_NUMBERS:,} at most: use fewer UAVs or larger cells"
            )
        members = np.flatnonzero(labels == part).astype(np.int32)
        own = cells.part(members)
        begin = own.index[cells.flat[shares.entries[uavs]]]
        targets = level_shares(len(own), carried[uavs])
        owner = divide(own, begin, targets, seed=seed)
        areas[members] = uavs[owner]
        load = np.bincount(owner, minlength=len(uavs)) + carried[uavs]
        spread = max(spread, int(np.ptp(load)))
    return spread


def _routes(
    cells: CoverageCells, labels: Ints, shares: AreaShares, areas: Ints
) -> tuple[tuple[CoverageTour, ...], ...]:
    """Returns the tours of each UAV, that of its own part first."""
    first = [(int(u), int(shares.entries[u])) for u in np.flatnonzero(shares.entries >= 0)]
    legs: Sequence[tuple[int, int]] = first + [(v.uav, v.entry) for v in shares.visits]
    number = np.full(len(cells), -1, np.int32)
    # an area is one UAV's cells of one part: number areas so that trees do not mix
    keys = labels.astype(np.int64) * (len(shares.entries) + 1) + areas + 1
    entries = np.array([entry for _, entry in legs], np.int32)
    known, inverse = np.unique(keys, return_inverse=True)
    leg_of_key = np.full(len(known), -1, np.int32)
    leg_of_key[np.searchsorted(known, keys[entries])] = np.arange(len(legs), dtype=np.int32)
    number[:] = leg_of_key[inverse]
    routes: list[list[CoverageTour]] = [[] for _ in shares.entries]
    for (uav, _), tour in zip(legs, tours(cells, number, entries), strict=True):
        routes[uav].append(tour)
    return tuple(tuple(route) for route in routes)
