"""Noise of a bank's sensors: numbered draws from named streams, and drifting biases."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core import rng
from volery.core.arrays import Array
from volery.core.compiled import brief_kernel


class NoiseStreams:
    """Normal numbers of S sensors, each counted from its own start.

    Row i draws from stream `keys[i]`: first `at_start` numbers for the sensor's start, then
    `per_measurement` for each measurement. The draws of measurement k do not depend on other rows
    or earlier calls. Without `keys` all numbers are zero. Kernels that draw random numbers
    themselves, those of LIDARs and cameras, use `keys` (S,) and `first_k` (S,), the number of each
    sensor's first measurement.
    """

    def __init__(
        self,
        keys: NDArray[np.uint64] | None,
        sensors: int,
        *,
        at_start: int = 0,
        per_measurement: int = 0,
    ) -> None:
        self.enabled = keys is not None
        self.keys = np.zeros(sensors, np.uint64) if keys is None else np.array(keys, np.uint64)
        self.first_k = np.zeros(sensors, np.int64)
        self._at_start = at_start
        self._per_measurement = per_measurement

    def start(self) -> Array:
        """Returns the numbers of the start, (S, at_start)."""
        out = np.zeros((len(self.keys), self._at_start))
        if self.enabled:
            rng.fill_normal(self.keys, 0, out)
        return out

    def measurement(self, k: int) -> Array:
        """Returns the numbers of measurement `k`, (S, per_measurement)."""
        out = np.zeros((len(self.keys), self._per_measurement))
        if self.enabled:
            rng.fill_normal_draws(self.keys, self.first_k, k, self._at_start, out)
        return out

    def restart(self, rows: NDArray[np.int64], keys: NDArray[np.uint64] | None, k: int) -> None:
        """Restarts `rows` (R,): measurement `k` draws the numbers of a new sensor's first one.

        `keys` (R,) are their new streams; None leaves the streams unchanged, and sensors without
        noise ignore them.
        """
        self.first_k[rows] = k
        if keys is not None and self.enabled:
            self.keys[rows] = keys

    def get_state(self) -> dict[str, Any]:
        """Returns copies of keys and first measurement numbers."""
        return {"keys": self.keys.copy(), "first_k": self.first_k.copy()}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Restores a state of `get_state`."""
        self.keys = np.array(state["keys"], np.uint64)
        self.first_k = np.array(state["first_k"], np.int64)


class GaussMarkov(NamedTuple):
    """A first-order Gauss-Markov process in steps: b+ = decay b + step n, n standard normal."""

    decay: Array
    step: Array
    sigma: Array
    """Long-run standard deviation."""


@brief_kernel
def add_errors(
    readings: Array,
    noise: Array,
    constant: Array,
    bias: Array,
    white: Array,
    decay: Array,
    step: Array,
) -> None:
    """Adds constant, bias and white noise to `readings` (S, M), and advances the bias by a step.

    noise: (S, 2 M) normal numbers, first those of the white noise. constant, bias: (S, M). white:
    (M,) standard deviations; decay, step: (M,), of `GaussMarkov`.
    """
    sensors, axes = readings.shape
    for i in range(sensors):
        for j in range(axes):
            readings[i, j] += constant[i, j] + bias[i, j] + white[j] * noise[i, j]
            bias[i, j] = decay[j] * bias[i, j] + step[j] * noise[i, axes + j]


def gauss_markov(walk: ArrayLike, correlation_s: ArrayLike, dt_s: float) -> GaussMarkov:
    """Returns the process driven by white noise of density `walk` (unit/s/sqrt(Hz)).

    b+ = exp(-dt/tau) b + walk sqrt(tau/2 (1 - exp(-2 dt/tau))) n, as in PX4 and RotorS; exact for
    steps of `dt_s`.
    """
    tau = np.asarray(correlation_s, dtype=np.float64)
    decay = np.exp(-dt_s / tau)
    sigma = np.asarray(walk, dtype=np.float64) * np.sqrt(tau / 2.0)
    return GaussMarkov(decay, np.asarray(sigma * np.sqrt(1.0 - decay**2)), sigma)


def gauss_markov_of_sigma(sigma: ArrayLike, correlation_s: float, dt_s: float) -> GaussMarkov:
    """Returns the process with a given long-run standard deviation."""
    return gauss_markov(np.asarray(sigma) * np.sqrt(2.0 / correlation_s), correlation_s, dt_s)
