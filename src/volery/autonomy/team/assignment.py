"""Who searches which sector: the same answer for everyone who knows the same.

Each UAV decides for itself by what it has heard. Two that know different things may take the same
sector: the one that began later gives way as soon as it hears of it. Nobody may take none that is
left, so nothing stays unsearched.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


class SectorClaim(NamedTuple):
    """Who searches a sector since when, ns; of two the lesser one counts."""

    since_ns: int
    name: str


class Worker(NamedTuple):
    """A UAV that searches, or could."""

    place: Array
    """(2,) m, map"""
    sector: int
    """-1: none."""
    since_ns: int
    given_up: Mask
    """(S,) sectors to which it cannot get."""


def assign(workers: Mapping[str, Worker], searched: Mask, centres: Array) -> dict[str, int]:
    """A sector for each worker that has none, where there is one for it.

    searched: (S,). centres: (S, 2) m. The cheapest pair of worker and sector first; a sector costs
    its distance, and as much again as another worker is nearer to it.
    """
    held = {worker.sector for worker in workers.values()}
    free = [s for s in range(len(searched)) if not searched[s] and s not in held]
    idle = [name for name, worker in sorted(workers.items()) if worker.sector < 0]
    if not free or not idle:
        return {}
    names = sorted(workers)
    places = np.array([workers[name].place for name in names])
    away = np.linalg.norm(places[:, None, :] - centres[None, free, :], axis=2)
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
    """Whether somebody else searches my sector by an earlier claim."""
    claims = [
        SectorClaim(other.since_ns, name)
        for name, other in others.items()
        if other.sector == sector
    ]
    return any(claim < mine for claim in claims)
