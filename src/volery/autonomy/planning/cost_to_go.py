"""Computes the cost from each position near the vehicle to its goal: a navigation function.

Dijkstra's algorithm on the cells of the flight surface, from the goal outwards. A metre costs 1,
more near obstacles and in unknown space. The trajectory descends this function within the limits of
the vehicle, as in O. Brock and O. Khatib, "High-speed navigation using the global dynamic window
approach", ICRA 1999.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.planning.clearance import Clearance
from volery.autonomy.planning.distances import Squares
from volery.autonomy.planning.surface import Surface
from volery.core.arrays import Array
from volery.core.compiled import inner_kernel, kernel

Integers = NDArray[np.int64]

_SEED_M = 2.5
"""Radius of the cells around the goal that seed the search: the goal itself may be blocked."""
_SEED_COST = 2.0
"""Cost of a metre between a seed cell and the goal."""


class CellCosts(NamedTuple):
    """Additional costs of a metre; the base cost is 1."""

    radius_m: float
    """Distance to obstacles below which a metre costs `squeeze` more."""
    soft_m: float
    """Distance to obstacles at which the cost begins to grow; it reaches `near` at `radius_m`."""
    near: float = 3.0
    squeeze: float = 30.0
    unknown: float = 0.6
    """Cost in unknown space, which may be free."""
    aside: float = 0.5
    """Cost for each metre over or under the wanted height."""


class CostToGo(NamedTuple):
    """Costs of the columns of a window."""

    cost: Array
    """(nx, ny); inf where no path leads to the goal."""
    low: Integers
    """(2,): index of the lowest cell, counted from the frame's origin."""
    cell_m: float

    def at(self, xy: Array) -> float:
        """Returns the cost at a position (2,) m; inf outside of the window."""
        i, j = (np.floor(xy / self.cell_m).astype(np.int64) - self.low).tolist()
        rows, columns = self.cost.shape
        return float(self.cost[i, j]) if 0 <= i < rows and 0 <= j < columns else math.inf

    def descent(self, xy: Array, radius_m: float = 2.0) -> float | None:
        """Returns the direction (rad) of the cheapest cell at `radius_m`; None if none is lower."""
        angles = np.arange(0.0, 2.0 * math.pi, math.pi / 18.0)
        around = xy + radius_m * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        costs = [self.at(position) for position in around]
        best = int(np.argmin(costs))
        return float(angles[best]) if costs[best] < self.at(xy) else None


def cost_to_go(
    clearance: Clearance, surface: Surface, offsets: Array, goal: Array, prices: CellCosts
) -> CostToGo:
    """Returns the costs to `goal` (2,) m, at heights of `surface` plus one of `offsets` (K,) m."""
    nx, ny, _ = clearance.square.shape
    price, cost = np.empty((nx, ny)), np.full((nx, ny), np.inf)
    _price(
        clearance.square,
        clearance.known,
        clearance.low,
        clearance.cell_m,
        surface.level,
        surface.slope,
        offsets,
        np.array(prices),
        price,
    )
    heap_cost, heap_cell = np.empty(8 * nx * ny), np.empty(8 * nx * ny, np.int64)
    seed = (goal / clearance.cell_m) - clearance.low[:2]
    _spread(price, seed, clearance.cell_m, cost, heap_cost, heap_cell)
    return CostToGo(cost, clearance.low[:2], clearance.cell_m)


@kernel
def _price(
    square: Squares,
    known: NDArray[np.bool_],
    low: Integers,
    cell: float,
    level: float,
    slope: Array,
    offsets: Array,
    prices: Array,
    price: Array,
) -> None:
    """Computes the price of a metre in each column, at the best height; inf if all are occupied."""
    nx, ny, nz = square.shape
    radius, soft, near, squeeze, unknown, aside = prices
    for i in range(nx):
        for j in range(ny):
            x, y = (i + low[0] + 0.5) * cell, (j + low[1] + 0.5) * cell
            best = math.inf
            for offset in offsets:
                z = level + slope[0] * x + slope[1] * y + offset
                k = math.floor(z / cell) - low[2]
                if not 0 <= k < nz or square[i, j, k] == 0:
                    continue
                distance = math.sqrt(square[i, j, k]) * cell
                here = 1.0 + aside * abs(offset)
                if distance < radius:
                    here += squeeze
                elif distance < soft:
                    lack = (soft - distance) / (soft - radius)
                    here += near * lack * lack
                if not known[i, j, k]:
                    here += unknown
                best = min(best, here)
            price[i, j] = best


@kernel
def _spread(
    price: Array, seed: Array, cell: float, cost: Array, heap_cost: Array, heap_cell: Integers
) -> None:
    nx, ny = price.shape
    size = 0
    gx = min(max(seed[0], 0.5), nx - 0.5)
    gy = min(max(seed[1], 0.5), ny - 0.5)
    for i in range(nx):
        for j in range(ny):
            away = cell * math.sqrt((i + 0.5 - gx) ** 2 + (j + 0.5 - gy) ** 2)
            if away <= _SEED_M and price[i, j] < math.inf:
                cost[i, j] = _SEED_COST * away
                size = _push(heap_cost, heap_cell, size, cost[i, j], i * ny + j)
    while size > 0:
        here, at = heap_cost[0], heap_cell[0]
        size = _pop(heap_cost, heap_cell, size)
        i, j = at // ny, at % ny
        if here > cost[i, j]:
            continue
        for di in range(-1, 2):
            for dj in range(-1, 2):
                a, b = i + di, j + dj
                if (di == 0 and dj == 0) or not (0 <= a < nx and 0 <= b < ny):
                    continue
                length = cell * (1.4142135623730951 if di != 0 and dj != 0 else 1.0)
                other = here + length * 0.5 * (price[i, j] + price[a, b])
                if other < cost[a, b] - 1e-9 and size < len(heap_cost):
                    cost[a, b] = other
                    size = _push(heap_cost, heap_cell, size, other, a * ny + b)


@inner_kernel
def _push(heap_cost: Array, heap_cell: Integers, size: int, cost: float, cell: int) -> int:
    """Adds an element to a binary heap; returns its new size."""
    at = size
    while at > 0:
        above = (at - 1) // 2
        if heap_cost[above] <= cost:
            break
        heap_cost[at], heap_cell[at] = heap_cost[above], heap_cell[above]
        at = above
    heap_cost[at], heap_cell[at] = cost, cell
    return size + 1


@inner_kernel
def _pop(heap_cost: Array, heap_cell: Integers, size: int) -> int:
    """Removes the top of a binary heap; returns its new size."""
    size -= 1
    cost, cell = heap_cost[size], heap_cell[size]
    at = 0
    while True:
        below = 2 * at + 1
        if below >= size:
            break
        if below + 1 < size and heap_cost[below + 1] < heap_cost[below]:
            below += 1
        if heap_cost[below] >= cost:
            break
        heap_cost[at], heap_cell[at] = heap_cost[below], heap_cell[below]
        at = below
    heap_cost[at], heap_cell[at] = cost, cell
    return size
