"""Balances areas to their exact sizes by moving cells across borders."""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.autonomy.coverage.cells import Ints
from volery.autonomy.coverage.joining import walk_part
from volery.core.compiled import inner_kernel, kernel, owning_kernel

_WALK_LOOKS = 4
"""Checks that a step of a walk through an area counts as, because of its random memory access."""
_MAX_TRIES_PER_PAIR = 40
"""Chains of exchanges tried for each pair of UAVs. Modelling choice: most maps need a handful."""


@kernel
def balance(
    neighbours: Ints, starts: Ints, targets: Any, distances: Any, owner: Ints, max_looks: int
) -> None:
    """Moves cells from areas that are too large to those that are too small, area by area.

    `owner` must hold connected areas; they stay connected. Cells move along the shortest chain of
    adjacent areas. At a border, cells that are nearest to their new start relative to their old one
    move first. It stops after `max_looks` checks of cells.
    """
    count, robots = owner.shape[0], starts.shape[0]
    surplus = np.empty(robots, np.int64)
    for r in range(robots):
        surplus[r] = -targets[r]
    for k in range(count):
        surplus[owner[k]] += 1
    closed = np.zeros((robots, robots), np.bool_)
    touch = np.zeros((robots, robots), np.bool_)
    chain = np.empty(robots, np.int32)
    buffers = np.empty((2, count), np.int32)
    gaps = np.empty(count, np.float32)
    seen = np.zeros(count, np.bool_)
    looks = np.full(1, max_looks)
    for _ in range(_MAX_TRIES_PER_PAIR * robots * robots):
        if (surplus == 0).all() or looks[0] < 0:
            return
        looks[0] -= count
        _find_touching(neighbours, owner, touch)
        links = _find_chain(touch, closed, surplus, chain)
        if links < 2:
            return
        amount = min(surplus[chain[0]], -surplus[chain[links - 1]])
        for i in range(links - 1):
            giver, taker = chain[i], chain[i + 1]
            amount = _hand_over(
                neighbours,
                starts[giver],
                giver,
                taker,
                amount,
                distances,
                owner,
                buffers,
                gaps,
                seen,
                looks,
            )
            surplus[giver] -= amount
            surplus[taker] += amount
            if amount == 0:
                closed[giver, taker] = True
                break
            if i == links - 2:
                closed[:] = False


@inner_kernel
def _find_touching(neighbours: Ints, owner: Ints, touch: Any) -> None:
    touch[:] = False
    for k in range(owner.shape[0]):
        for side in range(2):  # east and north: each border once
            other = neighbours[k, side]
            if other >= 0 and owner[other] != owner[k]:
                touch[owner[k], owner[other]] = True
                touch[owner[other], owner[k]] = True


@owning_kernel
def _find_chain(touch: Any, closed: Any, surplus: Any, chain: Ints) -> int:
    """Finds areas from one that is too large to the nearest too small one; returns their number.

    The largest surplus comes first. 0: no chain.
    """
    robots = surplus.shape[0]
    before = np.empty(robots, np.int32)
    queue = np.empty(robots, np.int32)
    tried = np.zeros(robots, np.bool_)
    while True:
        first = -1
        for r in range(robots):
            if surplus[r] > 0 and not tried[r] and (first < 0 or surplus[r] > surplus[first]):
                first = r
        if first < 0:
            return 0
        tried[first] = True
        before[:] = -1
        before[first] = first
        queue[0], head, tail = first, 0, 1
        while head < tail:
            giver = queue[head]
            head += 1
            for taker in range(robots):
                if touch[giver, taker] and not closed[giver, taker] and before[taker] < 0:
                    before[taker] = giver
                    queue[tail] = taker
                    tail += 1
                    if surplus[taker] < 0:
                        links = 1
                        r = taker
                        while r != first:
                            r = before[r]
                            links += 1
                        r = taker
                        for i in range(links - 1, -1, -1):
                            chain[i] = r
                            r = before[r]
                        return links


@owning_kernel
def _hand_over(
    neighbours: Ints,
    start: int,
    giver: int,
    taker: int,
    amount: int,
    distances: Any,
    owner: Ints,
    buffers: Any,
    gaps: Any,
    seen: Any,
    looks: Any,
) -> int:
    """Moves about `amount` cells from `giver` to `taker`; returns the number moved.

    Single cells move first. Then a cell moves with all cells that only it connects to its area: up
    to the wanted amount, or somewhat more if both areas still get nearer to their sizes.
    """
    moved = 0
    border = buffers[0]
    while moved < amount and looks[0] >= 0:
        looks[0] -= owner.shape[0]
        tail = _find_border(neighbours, start, giver, taker, distances, owner, border, gaps)
        order = np.argsort(gaps[:tail], kind="mergesort")
        before = moved
        for i in order:
            k = border[i]
            if moved < amount and _is_loose(neighbours, owner, k):
                owner[k] = taker
                moved += 1
        if moved == before:
            moved += _hand_over_held(
                neighbours,
                start,
                taker,
                amount - moved,
                owner,
                border[order],
                buffers[1],
                seen,
                looks,
            )
        if moved == before:
            break
    return moved


@inner_kernel
def _find_border(
    neighbours: Ints,
    start: int,
    giver: int,
    taker: int,
    distances: Any,
    owner: Ints,
    border: Ints,
    gaps: Any,
) -> int:
    """Fills the giver's cells beside `taker` and their gain in distance; returns their number."""
    found = 0
    for k in range(owner.shape[0]):
        if owner[k] == giver and k != start and _touches(neighbours, owner, k, taker):
            border[found] = k
            gaps[found] = distances[taker, k] - distances[giver, k]
            found += 1
    return found


@inner_kernel
def _hand_over_held(
    neighbours: Ints,
    start: int,
    taker: int,
    amount: int,
    owner: Ints,
    border: Ints,
    queue: Ints,
    seen: Any,
    looks: Any,
) -> int:
    """Moves one cell of `border` with all that it alone connects; returns the number moved.

    It is the first that moves at most `amount` cells, else the one that moves fewest, below twice
    that.
    """
    smallest, chosen = 2 * amount, -1
    for k in border:
        if looks[0] < 0:
            break
        size = _held_by(neighbours, start, owner, k, queue, seen)
        looks[0] -= _WALK_LOOKS * owner.shape[0]
        if size < smallest:
            smallest, chosen = size, k
        if size <= amount:
            break
    if chosen < 0:
        return 0
    giver = owner[chosen]
    _held_by(neighbours, start, owner, chosen, queue, seen)
    for k in range(owner.shape[0]):
        if owner[k] == giver and (k == chosen or not seen[k]):
            owner[k] = taker
    return smallest


@inner_kernel
def _touches(neighbours: Ints, owner: Ints, k: int, taker: int) -> bool:
    for side in range(4):
        other = neighbours[k, side]
        if other >= 0 and owner[other] == taker:
            return True
    return False


@inner_kernel
def _is_loose(neighbours: Ints, owner: Ints, k: int) -> bool:
    """Returns whether the area of k stays connected without it, by the cells around it."""
    own = owner[k]
    sides, links = 0, 0
    for side in range(4):
        one, across = neighbours[k, side], neighbours[k, 4 + side]
        if one < 0 or owner[one] != own:
            continue
        sides += 1
        other = neighbours[k, (side + 1) % 4]
        if other >= 0 and owner[other] == own and across >= 0 and owner[across] == own:
            links += 1
    return sides - links == 1


@inner_kernel
def _held_by(neighbours: Ints, start: int, owner: Ints, k: int, queue: Ints, seen: Any) -> int:
    """Returns how many cells its area loses with cell k, itself included; `seen` marks the rest."""
    own = owner[k]
    size = 0
    for other in range(owner.shape[0]):
        seen[other] = False
        if owner[other] == own:
            size += 1
    seen[k] = True
    return size - walk_part(neighbours, owner, start, queue, seen)
