"""The contract of swarm behaviours: one object over arrays moves all UAVs of a swarm.

A behaviour of your own is a class with `radius_m` and `velocities`. The node `flock` runs it for a
team on the graph; in a `VectorizedSimulation` its velocities are commanded in batches.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.compiled import kernel

NO_ARENA = (-np.inf, -np.inf, np.inf, np.inf)


class Surroundings(NamedTuple):
    """What a swarm must not touch, in the plane."""

    arena: Array = np.array(NO_ARENA)
    """(4,) x_min, y_min, x_max, y_max, m: walls around the swarm."""
    cylinders: Array = np.empty((0, 3))
    """(M, 3) x, y, radius, m: posts, trunks."""
    echoes: Array = np.empty((0, 0, 2))
    """(N, S, 2) m: what each UAV's own sensor sees, as offsets from it; NaN: nothing."""


class Flock(NamedTuple):
    """Describes N UAVs in the plane, and which of them are near each other."""

    position: Array
    """(N, 2) m."""
    velocity: Array
    """(N, 2) m/s."""
    first: NDArray[np.int64]
    """(N + 1,): the neighbours of i are neighbour[first[i]:first[i + 1]]."""
    neighbour: NDArray[np.int64]
    """Rows of the neighbours."""


class SwarmBehaviour(Protocol):
    """Decides the velocities of a swarm."""

    radius_m: float
    """Distance within which UAVs are neighbours."""

    def velocities(self, flock: Flock, preferred: Array, around: Surroundings) -> Array:
        """Returns commanded velocities (N, 2) m/s; preferred (N, 2) m/s lead to the goals."""


def flock_within(position: Array, velocity: Array, radius_m: float) -> Flock:
    """Returns the flock at positions (N, 2) m with velocities (N, 2) m/s."""
    cells = np.floor(position / radius_m).astype(np.int64)
    cells -= cells.min(axis=0, initial=0) - 1
    height = int(cells[:, 1].max(initial=0)) + 2
    keys = cells[:, 0] * height + cells[:, 1]
    order = np.argsort(keys, kind="stable")
    first, neighbour = _near_each_other(position, keys, order, height, radius_m)
    return Flock(position, velocity, first, neighbour)


@kernel
def _near_each_other(
    position: Any, keys: Any, order: Any, height: int, radius: float
) -> tuple[Any, Any]:
    """Returns `first` and `neighbour` of a flock.

    keys: cells (N,), those of a column of the grid in a row; order: rows sorted by cell.
    """
    count = len(order)
    ordered = keys[order]
    first = np.zeros(count + 1, np.int64)
    neighbour = np.empty(0, np.int64)
    for fill in (False, True):
        if fill:
            neighbour = np.empty(first[count], np.int64)
        found = 0
        for i in range(count):
            first[i] = found
            for column in range(-1, 2):
                middle = keys[i] + column * height
                start = np.searchsorted(ordered, middle - 1)
                end = np.searchsorted(ordered, middle + 1, side="right")
                for j in order[start:end]:
                    x, y = position[j, 0] - position[i, 0], position[j, 1] - position[i, 1]
                    if j != i and x * x + y * y < radius * radius:
                        if fill:
                            neighbour[found] = j
                        found += 1
        first[count] = found
    return first, neighbour
