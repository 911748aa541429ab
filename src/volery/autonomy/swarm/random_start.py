"""Random starts of formations: positions and velocities of birds, after ARES."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from volery.core.arrays import Array

_BOX, _SEVEN = 3.0, 7
"""Side of the box of the starts of seven, wing spans; larger flocks are as dense."""
_SPEEDS = (0.25, 0.75)
"""Velocities per axis, wing spans per step."""
_APART = 1.2
"""Minimum distance of two starts, wing spans."""
_DRAWS, _MAX_DRAWS = 1_000, 50_000


class RandomStart(NamedTuple):
    """Where the birds of a flock start."""

    positions: Array
    """(N, 2) around the middle, wing spans, by increasing x: paths from a row hardly cross."""
    velocities: Array
    """(N, 2), wing spans per step."""


def random_start(count: int, seed: int) -> RandomStart:
    """Returns the start of `count` birds; the same arguments give the same one."""
    speeds = np.random.default_rng([seed, 1]).uniform(*_SPEEDS, (count, 2))
    return RandomStart(np.array(sorted(_apart(count, seed), key=lambda p: float(p[0]))), speeds)


def _apart(count: int, seed: int) -> list[Array]:
    rng = np.random.default_rng(seed)
    side = (_BOX + _APART) * math.sqrt(max(1.0, count / _SEVEN)) - _APART
    found: list[Array] = []
    for draw in range(_MAX_DRAWS):
        if draw % _DRAWS == 0:  # the first ones may leave no room
            found = []
        drawn = rng.uniform(-0.5 * side, 0.5 * side, 2)
        if all(math.dist(drawn, other) >= _APART for other in found):
            found.append(drawn)
        if len(found) == count:
            return found
    width = math.ceil(math.sqrt(count))  # too dense: a grid
    return [np.array([k % width, k // width], float) * _APART for k in range(count)]
