"""Areas of equal size for several UAVs, each connected and around its start: DARP.

The method of Kapoutsis, Chatzichristofis and Kosmatopoulos ("DARP: Divide Areas Algorithm for
Optimal Multi-Robot Coverage Path Planning", J. Intell. Robot. Syst. 86, 2017): a field E_r for each
UAV, initially the distance from its start; each cell belongs to the UAV with the smallest field.
Fields of UAVs with too many cells grow, those of UAVs with too few shrink. If an area is
disconnected, its field shrinks near the part with its start and grows near the others.

Two details differ from the article. Distances go around obstacles. And once the areas are nearly
right, or stop improving, `balance` moves cells across borders until the sizes are exact, where the
article continues with ever smaller corrections. If that fails, `growth` is the fallback.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.coverage.balance import balance
from volery.autonomy.coverage.cells import CoverageCells, Ints
from volery.autonomy.coverage.growth import grow
from volery.autonomy.coverage.joining import join_parts, walk_part
from volery.core.compiled import inner_kernel, kernel
from volery.core.rng import stream_key, uniform

MAX_ITERATIONS = 600
MAX_UPDATES = 300_000_000
"""Max cell updates of one division, some seconds on one core. Modelling choice."""
_NEAR_ENOUGH = 0.02
"""Fraction of the cells that `balance` may still have to move. Modelling choice."""
_LOOKS_A_CELL, _MAX_LOOKS = 3_000, 200_000_000
"""Limits of `balance`, a few seconds at most. Modelling choice."""
_GAIN = 0.25
"""Initial gain of the correction factors on the relative error of a share. Modelling choice."""
_MIN_GAIN = 0.01
"""Min gain; it is halved whenever a UAV changes from too many cells to too few."""
_VARIATION = 0.01
"""Max deviation of one iteration's connectivity factor from 1: the article's."""
_NOISE = 1e-4
"""Max deviation of one iteration's random factor from 1: the article's."""


def divide(
    cells: CoverageCells, starts: Ints, targets: NDArray[np.int64], *, seed: int = 1
) -> Ints:
    """Returns the UAV of each cell (n,): `targets[r]` connected cells around the start of UAV r.

    `cells` must be one component, `starts` (R,) different cells of it, `targets` positive with the
    sum n. If it cannot reach the targets it returns the best division found; areas are always
    connected.
    """
    fields = np.stack([cells.distances([int(start)]) for start in starts])
    distances = fields.copy()
    fields += np.float32(1e-3)  # so that a factor acts on the start as well
    owner = np.zeros(len(cells), np.int32)
    if len(starts) == 1:
        return owner
    iterations = min(MAX_ITERATIONS, max(10, MAX_UPDATES // fields.size))
    key = stream_key(seed, "coverage/darp")
    _iterate(cells.neighbours, starts, targets, fields, key, iterations, owner)
    join_parts(cells.neighbours, starts, targets, owner)
    looks = min(_LOOKS_A_CELL * len(cells), _MAX_LOOKS)
    balance(cells.neighbours, starts, targets, distances, owner, looks)
    if _missing(owner, targets):
        grown = grow(cells, starts, targets, distances)
        if _missing(grown, targets) < _missing(owner, targets):
            return grown
    return owner


def _missing(owner: Ints, targets: NDArray[np.int64]) -> int:
    """Returns the number of cells beyond the targets."""
    sizes = np.bincount(owner, minlength=len(targets))
    return int(np.abs(sizes - targets).sum()) // 2


@kernel
def _iterate(
    neighbours: Ints,
    starts: Ints,
    targets: Any,
    fields: Any,
    key: Any,
    iterations: int,
    owner: Ints,
) -> int:
    """Stores the best division in `owner`; returns the number of iterations."""
    robots, count = fields.shape
    here = np.empty(count, np.int32)
    queue = np.empty(count, np.int32)
    hops = np.empty((2, count), np.int32)
    part = np.zeros(count, np.bool_)
    sizes = np.empty(robots, np.int64)
    lost = np.empty(robots, np.int64)
    gain = np.full(robots, _GAIN)
    sides = np.zeros(robots)
    best = np.iinfo(np.int64).max
    near = max(robots, int(_NEAR_ENOUGH * count))
    for iteration in range(iterations):
        _assign(fields, starts, here, sizes)
        part[:] = False
        wrong = 0
        for r in range(robots):
            lost[r] = sizes[r] - walk_part(neighbours, here, starts[r], queue, part)
            wrong += lost[r] + abs(sizes[r] - targets[r])
        if wrong < best:
            best = wrong
            for k in range(count):
                owner[k] = here[k]
        if wrong <= near:
            return iteration
        for r in range(robots):
            error = (sizes[r] - targets[r]) / targets[r]
            if error * sides[r] < 0.0:
                gain[r] = max(0.5 * gain[r], _MIN_GAIN)
            sides[r] = error
            factor = min(max(1.0 + gain[r] * error, 0.5), 2.0)
            if lost[r]:
                _hops_from(neighbours, here, part, r, True, queue, hops[0])
                _hops_from(neighbours, here, part, r, False, queue, hops[1])
            for k in range(count):
                noise = 1.0 + _NOISE * (
                    2.0 * uniform(key, (iteration * robots + r) * count + k) - 1
                )
                scale = factor * noise
                if lost[r]:
                    own, other = hops[0, k], hops[1, k]
                    scale *= 1.0 + _VARIATION * (own - other) / max(own + other, 1)
                fields[r, k] *= scale
        _normalise(fields)
    return iterations


@inner_kernel
def _assign(fields: Any, starts: Ints, here: Ints, sizes: Any) -> None:
    """Assigns each cell to the UAV with the smallest field, each start to its own."""
    robots, count = fields.shape
    for k in range(count):
        nearest = 0
        for r in range(1, robots):
            if fields[r, k] < fields[nearest, k]:
                nearest = r
        here[k] = nearest
    for r in range(robots):
        here[starts[r]] = r
    sizes[:] = 0
    for k in range(count):
        sizes[here[k]] += 1


@inner_kernel
def _hops_from(
    neighbours: Ints, here: Ints, part: Any, robot: int, own: bool, queue: Ints, hops: Ints
) -> None:
    """Computes steps from the part of `robot` with its start (own), or from its other parts."""
    hops[:] = -1
    head, tail = 0, 0
    for k in range(hops.shape[0]):
        if here[k] == robot and part[k] == own:
            hops[k] = 0
            queue[tail] = k
            tail += 1
    while head < tail:
        k = queue[head]
        head += 1
        for side in range(4):
            other = neighbours[k, side]
            if other >= 0 and hops[other] < 0:
                hops[other] = hops[k] + 1
                queue[tail] = other
                tail += 1


@inner_kernel
def _normalise(fields: Any) -> None:
    """Rescales the fields: only their ratios matter."""
    middle = 0.0
    for r in range(fields.shape[0]):
        middle += np.log(fields[r, 0])
    middle = np.exp(-middle / fields.shape[0])
    if not 1e-6 < middle < 1e6:
        fields *= np.float32(middle)
