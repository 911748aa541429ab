"""What separates observations and actions from ideal ones: latency, noise, bias and history."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.errors import ScenarioError
from volery.learning.flight import Flight
from volery.learning.randomization import NOISE_SCALE
from volery.learning.task import Observation, Range, Task

Envs = NDArray[np.int64]


class _Drawn:
    """A number of each environment: fixed, or drawn anew for each episode."""

    def __init__(self, what: str, bounds: Range, num_envs: int) -> None:
        low, high = bounds if isinstance(bounds, tuple) else (bounds, bounds)
        if not 0.0 <= low <= high < np.inf:
            raise ScenarioError(
                f"{what} = {bounds}: a number from 0 on, or two with the smaller one first"
            )
        self.low, self.high = low, high
        self.values = np.full(num_envs, low)
        """(K,)."""

    @property
    def is_zero(self) -> bool:
        """Whether the number is always 0."""
        return self.high == 0.0

    def begin(self, flight: Flight, envs: Envs) -> None:
        """Draws the numbers of the episodes that begin in `envs` (R,)."""
        if self.high > self.low:
            self.values[envs] = flight.draws.uniform(envs, self.low, self.high)


class _Latency:
    """A latency in physics steps: `whole` decisions and `part` steps, (K,) each."""

    def __init__(self, what: str, bounds: Range, num_envs: int, dt_s: float, steps: int) -> None:
        self._drawn = _Drawn(f"{what}latency_s", bounds, num_envs)
        self._dt_s, self._steps = dt_s, steps
        low, high = (round(bound / dt_s) for bound in (self._drawn.low, self._drawn.high))
        self.depth = high // steps + 2
        """Decisions that must be stored."""
        self.parts = sorted({delay % steps for delay in range(low, high + 1)} | {0})
        """Steps after a decision that occur."""
        self.whole, self.part = np.divmod(np.full(num_envs, low), steps)

    @property
    def is_zero(self) -> bool:
        """Whether there is no latency."""
        return self._drawn.is_zero

    def begin(self, flight: Flight, envs: Envs) -> None:
        """Draws the latencies of the episodes that begin in `envs` (R,)."""
        self._drawn.begin(flight, envs)
        delay = np.rint(self._drawn.values[envs] / self._dt_s).astype(np.int64)
        self.whole[envs], self.part[envs] = np.divmod(delay, self._steps)


class ActionPath:
    """Takes actions from the policy to the vehicle: later, and with errors."""

    def __init__(self, task: Task, flight: Flight, steps: int) -> None:
        count, name = flight.num_envs, f"task '{task.name}': "
        self._latency = _Latency(
            f"{name}action_", task.action_latency_s, count, flight.envs.dt_ns * 1e-9, steps
        )
        self._noise, self._spread = (
            _Drawn(f"{name}action_noise", task.action_noise, count),
            _Drawn(f"{name}action_bias", task.action_bias, count),
        )
        self._has_errors = not (self._noise.is_zero and self._spread.is_zero)
        if self._has_errors and task.action.choices is not None:
            raise ScenarioError(f"{name}discrete actions have no noise or bias")
        self._flight = flight
        self._bias = np.zeros_like(flight.action)
        depth = 1 if self._latency.is_zero else self._latency.depth
        self._queue = np.zeros((depth, *flight.action.shape))
        self._all = np.arange(count)

    @property
    def offsets(self) -> list[int]:
        """Steps after a decision at which actions take effect."""
        return self._latency.parts

    def begin(self, envs: Envs) -> None:
        """Begins the episodes of `envs` (R,)."""
        self._queue[:, envs] = 0.0
        self._latency.begin(self._flight, envs)
        if self._has_errors:
            for drawn in (self._noise, self._spread):
                drawn.begin(self._flight, envs)
            self._bias[envs] = self._draw(self._spread, envs)

    def push(self, action: Array) -> None:
        """Takes the actions (K, n, A) of a decision."""
        if self._has_errors:
            action = action + self._bias + self._draw(self._noise, self._all)
            action = np.clip(action, -1.0, 1.0)
        if not self._latency.is_zero:
            self._queue[1:] = self._queue[:-1].copy()
        self._queue[0] = action

    def at(self, offset: int) -> Array:
        """Returns the actions (K, n, A) that act `offset` steps after the decision."""
        if self._latency.is_zero:
            return np.asarray(self._queue[0].copy())
        age = self._latency.whole + (self._latency.part > offset)
        return np.asarray(self._queue[age, self._all])

    def get_state(self) -> dict[str, Any]:
        """Returns copies of all arrays; each has a row per environment."""
        return {
            "queue": np.moveaxis(self._queue, 0, 1).copy(),
            "bias": self._bias.copy(),
            "noise": self._noise.values.copy(),
            "whole": self._latency.whole.copy(),
            "part": self._latency.part.copy(),
        }

    def set_state(self, state: dict[str, Any], envs: Envs | slice = slice(None)) -> None:
        """Restores a state of `get_state`, of the environments `envs` alone."""
        np.moveaxis(self._queue, 0, 1)[envs] = state["queue"][envs]
        self._bias[envs] = state["bias"][envs]
        self._noise.values[envs] = state["noise"][envs]
        self._latency.whole[envs] = state["whole"][envs]
        self._latency.part[envs] = state["part"][envs]

    def _draw(self, drawn: _Drawn, envs: Envs) -> Array:
        """Draws errors (R, n, A)."""
        sigma = drawn.values[envs, None, None]
        return self._flight.draws.normal(envs, sigma, self._flight.action.shape[1:])


class ObservationPath:
    """Takes the numbers of one part of the observation to the policy: later, and with errors.

    steps: physics steps of a decision. agents: number m of UAVs that the policy flies.
    """

    def __init__(self, part: Observation, flight: Flight, steps: int, agents: int) -> None:
        count, shape = flight.num_envs, (agents, part.size)
        name = f"observation '{part.name}': "
        if part.history < 1:
            raise ScenarioError(f"{name}history = {part.history}: from 1 on")
        self.part = part
        self._flight, self._steps, self._shape = flight, steps, shape
        self._latency = _Latency(name, part.latency_s, count, flight.envs.dt_ns * 1e-9, steps)
        self._noise = _Drawn(f"{name}noise", part.noise, count)
        self._spread = _Drawn(f"{name}bias", part.bias, count)
        self._bias = np.zeros((count, *shape))
        depth = 0 if self._latency.is_zero else self._latency.depth
        self._past = np.zeros((count, depth, *shape))
        """(K, decisions, m, size), the newest first."""
        self._now = np.zeros((count, *shape) if depth else (count, 0))
        history = part.history if part.history > 1 else 0
        self._history = np.zeros((count, agents, history, part.size))
        """(K, m, decisions, size), the oldest first."""
        self._is_first = np.ones(count, np.bool_)

    @property
    def offsets(self) -> list[int]:
        """Steps after a decision at which the numbers of the next one are recorded."""
        return [self._steps - part for part in self._latency.parts if part]

    def begin(self, envs: Envs) -> None:
        """Begins the episodes of `envs` (R,)."""
        self._is_first[envs] = True
        for drawn in (self._latency, self._noise, self._spread):
            drawn.begin(self._flight, envs)
        if not self._spread.is_zero:
            self._bias[envs] = self._errors(self._spread, envs)

    def record(self, offset: int) -> None:
        """Records the numbers of those environments that observe them `offset` steps later."""
        rows = np.flatnonzero(self._latency.part == self._steps - offset)
        if len(rows):
            self._now[rows] = self._values(rows)

    def observe(self, envs: Envs) -> Array:
        """Returns the numbers (R, m, size * history) of this decision; call it once for each."""
        numbers = self._values(envs)
        if not self._latency.is_zero:
            numbers = self._late(envs, numbers)
        if not self._spread.is_zero:
            numbers = numbers + self._bias[envs]
        if not self._noise.is_zero:
            numbers = numbers + self._errors(self._noise, envs)
        if self.part.history > 1:
            numbers = self._stack(envs, numbers)
        self._is_first[envs] = False
        return numbers

    def get_state(self) -> dict[str, Any]:
        """Returns copies of all arrays; each has a row per environment."""
        return {name: array.copy() for name, array in self._arrays().items()}

    def set_state(self, state: dict[str, Any], envs: Envs | slice = slice(None)) -> None:
        """Restores a state of `get_state`, of the environments `envs` alone."""
        for name, array in self._arrays().items():
            array[envs] = state[name][envs]

    def _arrays(self) -> dict[str, NDArray[Any]]:
        return {
            "bias": self._bias,
            "past": self._past,
            "now": self._now,
            "history": self._history,
            "is_first": self._is_first,
            "noise": self._noise.values,
            "whole": self._latency.whole,
            "part": self._latency.part,
        }

    def _values(self, envs: Envs) -> Array:
        """Returns the numbers (R, m, size) at present."""
        return self._flight.seen_from(self.part.source, self.part.function)[envs, : self._shape[0]]

    def _errors(self, drawn: _Drawn, envs: Envs) -> Array:
        """Draws errors (R, m, size), which the variation of the noise scales."""
        sigma = drawn.values[envs, None, None]
        scale = self._flight.varied.get(NOISE_SCALE)
        if scale is not None:
            sigma = sigma * scale[envs, : self._shape[0]]
        return self._flight.draws.normal(envs, sigma, self._shape)

    def _late(self, envs: Envs, numbers: Array) -> Array:
        inside = self._latency.part[envs] > 0
        newest = np.where(inside[:, None, None], self._now[envs], numbers)
        first = self._is_first[envs]
        past = self._past[envs]
        past[:, 1:] = past[:, :-1].copy()
        past[:, 0] = newest
        past[first] = numbers[first, None]
        self._past[envs] = past
        return np.asarray(past[np.arange(len(envs)), self._latency.whole[envs]])

    def _stack(self, envs: Envs, numbers: Array) -> Array:
        first = self._is_first[envs]
        history = self._history[envs]
        history[:, :, :-1] = history[:, :, 1:].copy()
        history[:, :, -1] = numbers
        history[first] = numbers[first, :, None]
        self._history[envs] = history
        return history.reshape(len(envs), self._shape[0], -1)
