"""Random numbers of many environments, each from a stream of its own."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.arrays import Array

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1, _MIX_2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_TWO_M53 = 2.0**-53
_SEEDS = np.uint64((1 << 63) - 1)


class Draws:
    """Streams of K environments: the numbers of one depend on its seed and on its draws alone.

    The generator is that of `core.rng`, as array operations.
    """

    def __init__(self, num_envs: int) -> None:
        self._keys = np.zeros(num_envs, np.uint64)
        self._counters = np.zeros(num_envs, np.uint64)

    def seed(self, rows: NDArray[np.int64], seeds: ArrayLike) -> None:
        """Restarts the streams of the environments `rows` (R,) with `seeds` (R,), integers."""
        self._keys[rows] = _bits(np.asarray(seeds, np.uint64), np.zeros(1, np.uint64))
        self._counters[rows] = 0

    def episode_seeds(self, rows: NDArray[np.int64]) -> list[int]:
        """Returns a seed (R,) of the simulation for a new episode of each of `rows`."""
        seeds: list[int] = (self._next(rows, 1)[:, 0] & _SEEDS).tolist()
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
        bits = self._next(rows, int(np.prod(shape)))
        unit = ((bits >> _S11).astype(np.float64) + 0.5) * _TWO_M53
        return unit.reshape(len(rows), *shape)

    def _next(self, rows: NDArray[np.int64], numbers: int) -> NDArray[np.uint64]:
        counters = np.add.outer(self._counters[rows], np.arange(numbers, dtype=np.uint64))
        self._counters[rows] += np.uint64(numbers)
        return _bits(self._keys[rows][:, None], counters.astype(np.uint64))


def _bits(keys: NDArray[np.uint64], counters: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Returns random bits, as `core.rng.random_bits` of arrays that broadcast."""
    with np.errstate(over="ignore"):
        z = keys + (counters + np.uint64(1)) * _GOLDEN
        z = (z ^ (z >> _S30)) * _MIX_1
        z = (z ^ (z >> _S27)) * _MIX_2
    return np.asarray(z ^ (z >> _S31))
