"""Assigns sectors to UAVs: a deterministic function of the shared state.

Each UAV decides for itself by the reports that it has received. Two UAVs with different reports may
choose the same sector: the one that began later yields once it receives the other's report. Each
UAV may choose any free sector, so none stays unsearched.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array

Mask = NDArray[np.bool_]


class SectorClaim(NamedTuple):
    """Start (ns) and name of a UAV that searches a sector; the smaller claim counts."""

    since_ns: int
    name: str


class Worker(NamedTuple):
    """A UAV that searches or could search."""

    position: Array
    """(2,) m, map."""
    sector: int
    """Current sector; -1: none."""
    since_ns: int
    given_up: Mask
    """(S,): sectors that it cannot reach."""


def assign(workers: Mapping[str, Worker], searched: Mask, centres: Array) -> dict[str, int]:
    """Returns a sector for each worker without one, as far as sectors are free.

    searched: (S,). centres: (S, 2) m. The cheapest pair of worker and sector comes first; a sector
    costs its distance plus the distance by which another worker is nearer.
    """
    held = {worker.sector for worker in workers.values()}
    free = [s for s in range(len(searched)) if not searched[s] and s not in held]
    idle = [name for name, worker in sorted(workers.items()) if worker.sector < 0]
    if not free or not idle:
        return {}
    names = sorted(workers)
    positions = np.array([workers[name].position for name in names])
    away = np.linalg.norm(positions[:, None, :] - centres[None, free, :], axis=2)
    nearest = away.min(axis=0)
    pairs = sorted(
        (float(2.0 * away[row, k] - nearest[k]), name, sector)
        for row, name in enumerate(names)
        if name in idle
        for k, sector in enumerate(free)
        if not workers[name].given_up[sector]
    )
    chosen: dict[str, int] = {}
    for _, name, sector in pairs:
        if name not in chosen and sector not in chosen.values():
            chosen[name] = sector
    return chosen


def must_yield(mine: SectorClaim, sector: int, others: Mapping[str, Worker]) -> bool:
    """Returns whether another UAV searches the same sector by an earlier claim."""
    claims = [
        SectorClaim(other.since_ns, name)
        for name, other in others.items()
        if other.sector == sector
    ]
    return any(claim < mine for claim in claims)
