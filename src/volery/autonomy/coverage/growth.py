"""Areas that grow from their starts simultaneously and stay balanced from the beginning.

If UAVs start side by side, a large area that its neighbours enclose can hardly be freed. Here the
map is added step by step, twice as much of it each time, nearest cells first, so that each area can
always expand.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.coverage.balance import balance
from volery.autonomy.coverage.cells import CoverageCells, Ints
from volery.autonomy.coverage.joining import join_parts

_LOOKS_A_CELL, _MAX_LOOKS = 10_000, 600_000_000
"""Limits of `balance`, some seconds at most for each doubling. Modelling choice."""


def grow(
    cells: CoverageCells, starts: Ints, targets: NDArray[np.int64], distances: NDArray[np.float32]
) -> Ints:
    """Returns the UAV of each cell (n,); arguments as for `darp.divide`.

    distances: (R, n) from each start.
    """
    count, robots = len(cells), len(starts)
    owner = np.full(count, -1, np.int32)
    owner[starts] = np.arange(robots, dtype=np.int32)
    order = np.argsort(distances.min(axis=0), kind="stable").astype(np.int32)
    size = robots
    while size < count:
        size = min(2 * size, count)
        members = np.sort(order[:size])
        part = cells.part(members)
        begin = part.index[cells.flat[starts]]
        present = _present_targets(part, begin, targets)
        area = owner[members]
        join_parts(part.neighbours, begin, present, area)
        looks = min(_LOOKS_A_CELL * size, _MAX_LOOKS)
        balance(part.neighbours, begin, present, distances[:, members], area, looks)
        owner[members] = area
    return owner


def _present_targets(
    part: CoverageCells, begin: Ints, targets: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Returns each UAV's target among the cells so far: its fraction of its component."""
    labels, pieces = part.components()
    sizes = np.bincount(labels, minlength=pieces)
    home = labels[begin]
    wanted = np.bincount(home, weights=targets, minlength=pieces)
    present = np.maximum((targets * sizes[home] / wanted[home]).astype(np.int64), 1)
    for piece in np.unique(home):
        uavs = np.flatnonzero(home == piece)
        while (missing := int(sizes[piece] - present[uavs].sum())) != 0:
            fair = uavs if missing > 0 else uavs[present[uavs] > 1]
            present[fair[: abs(missing)]] += np.sign(missing)
    return present
