"""Random numbers of many environments, each from a stream of its own."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.arrays import Array
from volery.core.compiled import brief_kernel
from volery.core.rng import random_bits, uniform

_SEEDS = np.uint64((1 << 63) - 1)


class Draws:
    """Streams of K environments: the numbers of one depend on its seed and on its draws alone.

    The generator is that of `core.rng`.
    """

    def __init__(self, num_envs: int) -> None:
        self._keys = np.zeros(num_envs, np.uint64)
        self._counters = np.zeros(num_envs, np.uint64)

    def seed(self, rows: NDArray[np.int64], seeds: ArrayLike) -> None:
        """Restarts the streams of the environments `rows` (R,) with `seeds` (R,), integers."""
        numbers = np.broadcast_to(np.asarray(seeds, np.uint64), rows.shape).copy()
        self._keys[rows] = _bits(numbers, np.zeros_like(numbers))
        self._counters[rows] = 0

    def episode_seeds(self, rows: NDArray[np.int64]) -> list[int]:
        """Returns a seed (R,) of the simulation for a new episode of each of `rows`."""
        seeds: list[int] = (_bits(*self._next(rows, 1)) & _SEEDS).tolist()
        return seeds

    def uniform(
        self,
        rows: NDArray[np.int64],
        low: ArrayLike = 0.0,
        high: ArrayLike = 1.0,
        shape: tuple[int, ...] = (),
    ) -> Array:
        """Returns uniform numbers (R, *shape) between `low` and `high`, which broadcast to it."""
        numbers = self._unit(rows, shape)
        bottom = np.asarray(low, np.float64)
        return np.asarray(bottom + (np.asarray(high, np.float64) - bottom) * numbers)

    def normal(
        self, rows: NDArray[np.int64], sigma: ArrayLike = 1.0, shape: tuple[int, ...] = ()
    ) -> Array:
        """Returns normal numbers (R, *shape) of mean 0; `sigma` broadcasts to it."""
        radius = np.sqrt(-2.0 * np.log(self._unit(rows, shape)))
        return np.asarray(sigma * radius * np.cos(2.0 * np.pi * self._unit(rows, shape)))

    def get_state(self) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Returns copies of keys and counters, for `set_state`."""
        return self._keys.copy(), self._counters.copy()

    def set_state(
        self,
        state: tuple[NDArray[np.uint64], NDArray[np.uint64]],
        envs: NDArray[np.int64] | slice = slice(None),
    ) -> None:
        """Restores a state of `get_state`, of the environments `envs` alone."""
        keys, counters = state
        self._keys[envs], self._counters[envs] = keys[envs], counters[envs]

    def _unit(self, rows: NDArray[np.int64], shape: tuple[int, ...]) -> Array:
        """Returns uniform numbers (R, *shape) in (0, 1)."""
        numbers = math.prod(shape)
        return _units(*self._next(rows, numbers), numbers).reshape(len(rows), *shape)

    def _next(
        self, rows: NDArray[np.int64], numbers: int
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint64]]:
        """Returns keys and first counters (R,) of the next `numbers`, which are then used up."""
        counters = self._counters[rows]
        self._counters[rows] += np.uint64(numbers)
        return self._keys[rows], counters


@brief_kernel
def _bits(keys: NDArray[np.uint64], counters: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Returns random bits (R,): number `counters` of each stream."""
    bits = np.empty(len(keys), np.uint64)
    for i in range(len(keys)):
        bits[i] = random_bits(keys[i], counters[i])
    return bits


@brief_kernel
def _units(keys: NDArray[np.uint64], counters: NDArray[np.uint64], numbers: int) -> Array:
    """Returns uniform numbers (R, `numbers`) in (0, 1), from `counters` of each stream on."""
    units = np.empty((len(keys), numbers))
    for i in range(len(keys)):
        for j in range(numbers):
            units[i, j] = uniform(keys[i], counters[i] + np.uint64(j))
    return units
