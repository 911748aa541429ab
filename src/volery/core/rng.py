"""Provides named, counter-based random streams: no hidden state, the same numbers on any thread.

A stream is a 64-bit key made from the run's seed and a name such as `uav1/laser/horizontal`. Its
k-th number depends on key and k only, so adding a UAV or a sensor changes no other noise, kernels
may draw in any order, and a snapshot needs only the counters.

The generator is SplitMix64's output function (Steele, Lea, Flood, 2014) over `key + k * golden`,
with the key itself the SHA-256 of seed and name. Normal numbers come from the inverse of the normal
distribution function (P. J. Acklam's rational approximation, relative error below 1.15e-9).
"""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import brief_kernel, inline_kernel, kernel

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)
_TWO_M53 = 1.0 / (1 << 53)


def stream_key(seed: int, name: str) -> np.uint64:
    """Returns the key of the stream `name` in a run with `seed`."""
    digest = hashlib.sha256(f"{seed}/{name}".encode()).digest()
    return np.uint64(int.from_bytes(digest[:8], "little"))


def generator(seed: int, name: str) -> np.random.Generator:
    """Returns a numpy generator for one-time work, such as growing trees."""
    digest = hashlib.sha256(f"{seed}/{name}".encode()).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(digest[:16], "little")))


@inline_kernel
def random_bits(key: np.uint64, counter: int) -> np.uint64:
    """Returns 64 random bits: number `counter` (>= 0) of stream `key`."""
    z = key + (np.uint64(counter) + np.uint64(1)) * _GOLDEN
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    return z ^ (z >> _S31)


@inline_kernel
def uniform(key: np.uint64, counter: int) -> float:
    """Returns a uniform number in (0, 1)."""
    return (float(random_bits(key, counter) >> _S11) + 0.5) * _TWO_M53


@inline_kernel
def normal_quantile(p: float) -> float:
    """Computes the inverse of the standard normal distribution function, p in (0, 1)."""
    if 0.02425 <= p <= 0.97575:
        q = p - 0.5
        r = q * q
        top = (
            (
                ((-39.69683028665376 * r + 220.9460984245205) * r - 275.9285104469687) * r
                + 138.3577518672690
            )
            * r
            - 30.66479806614716
        ) * r + 2.506628277459239
        low = (
            (
                ((-54.47609879822406 * r + 161.5858368580409) * r - 155.6989798598866) * r
                + 66.80131188771972
            )
            * r
            - 13.28068155288572
        ) * r + 1.0
        return q * top / low
    tail = p if p < 0.5 else 1.0 - p
    q = np.sqrt(-2.0 * np.log(tail))
    top = (
        (
            ((-0.007784894002430293 * q - 0.3223964580411365) * q - 2.400758277161838) * q
            - 2.549732539343734
        )
        * q
        + 4.374664141464968
    ) * q + 2.938163982698783
    low = (
        ((0.007784695709041462 * q + 0.3224671290700398) * q + 2.445134137142996) * q
        + 3.754408661907416
    ) * q + 1.0
    quantile: float = top / low if p < 0.5 else -top / low
    return quantile


@inline_kernel
def normal(key: np.uint64, counter: int) -> float:
    """Returns standard normal number `counter` of stream `key`."""
    return normal_quantile(uniform(key, counter))


@kernel
def fill_normal(keys: NDArray[np.uint64], counter: int, out: NDArray[np.float64]) -> None:
    """Fills rows with standard normal numbers: row i holds numbers counter.. of keys[i]."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = normal(keys[i], counter + j)


@brief_kernel
def fill_normal_draws(
    keys: NDArray[np.uint64],
    first_draw: NDArray[np.int64],
    draw: int,
    skipped: int,
    out: NDArray[np.float64],
) -> None:
    """Fills rows with the numbers of draw `draw` of streams that began at draws `first_draw`.

    Row i takes the next `out.shape[1]` numbers of keys[i], after `skipped` at its start.
    """
    for i in range(out.shape[0]):
        counter = skipped + out.shape[1] * (draw - first_draw[i])
        for j in range(out.shape[1]):
            out[i, j] = normal(keys[i], counter + j)
