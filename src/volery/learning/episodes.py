"""The episodes of a task in many environments: decisions, rewards, ends and new beginnings."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError, ScenarioError
from volery.learning.flight import Flight
from volery.learning.task import Task
from volery.runtime.vectorized_simulation import VectorizedSimulation


class Outcome(NamedTuple):
    """What one decision brought, in K environments of n UAVs."""

    reward: Array
    """(K, n)."""
    terminated: NDArray[np.bool_]
    """(K,) whether the task ended the episode."""
    truncated: NDArray[np.bool_]
    """(K,) whether the time limit ended it."""
    success: NDArray[np.bool_]
    """(K,) whether it ended with success."""


class Episodes:
    """Runs the episodes of `task` in `num_envs` environments."""

    def __init__(self, task: Task, num_envs: int, *, seed: int = 0, threads: int = 2) -> None:
        self.task = task
        self.envs = VectorizedSimulation(
            task.scenario(), num_envs, seeds=[0] * num_envs, threads=threads
        )
        self._steps = _steps_of(task, self.envs.dt_ns)
        self.flight = Flight(self.envs, task.action.size, task.decision_rate_hz)
        shape = (num_envs, self.flight.num_uavs)
        for name, own in task.values.items():
            self.flight.values[name] = np.zeros((num_envs, *own))
        self._delayed = np.zeros((task.action_delay, *shape, task.action.size))
        self.returns = np.zeros(shape)
        """(K, n) sums of rewards since the start of the episode."""
        self.reward_sums = {part.name: np.zeros(shape) for part in task.rewards}
        """(K, n) sums of each weighted reward, by name."""
        self.seed(np.arange(num_envs) + seed)

    def seed(self, seeds: NDArray[np.int64], envs: NDArray[np.int64] | None = None) -> None:
        """Restarts the random streams of `envs` (R,) (None: all) with `seeds` (R,)."""
        rows = np.arange(self.flight.num_envs) if envs is None else envs
        self.flight.draws.seed(rows, seeds)

    def begin(self, envs: NDArray[np.int64]) -> None:
        """Begins new episodes in the environments `envs` (R,)."""
        if not len(envs):
            return
        flight = self.flight
        seeds = flight.draws.episode_seeds(envs)
        start = self.task.begin(flight, envs)
        self.envs.reset(envs, seeds, start=start)
        flight.refresh()
        flight.decisions[envs] = 0
        for array in (flight.action, flight.previous_action, self.returns):
            array[envs] = 0.0
        self._delayed[:, envs] = 0.0
        for sums in self.reward_sums.values():
            sums[envs] = 0.0

    def decide(self, action: Array) -> Outcome:
        """Acts, advances by one decision and returns its outcome; action: (K, n, A)."""
        flight, task = self.flight, self.task
        flight.previous_action, flight.action = flight.action, action
        task.action.command(flight, self._late(action))
        self.envs.step(self._steps)
        self.envs.drain_events()
        flight.refresh()
        flight.decisions += 1
        reward = np.zeros((flight.num_envs, flight.num_uavs))
        for part in task.rewards:
            share = part.weight * part.function(flight)
            self.reward_sums[part.name] += share
            reward += share
        terminated = np.zeros(flight.num_envs, np.bool_)
        success = np.zeros(flight.num_envs, np.bool_)
        for end in task.terminations:
            ends = end.function(flight) & ~terminated
            reward += end.reward * ends[:, None]
            terminated |= ends
            if end.is_success:
                success |= ends
        truncated = (flight.decisions >= task.episode_decisions) & ~terminated
        if task.success is not None and truncated.any():
            success |= truncated & task.success(flight)
        self.returns += reward
        return Outcome(reward, terminated, truncated, success)

    def observe(self, envs: NDArray[np.int64]) -> NDArray[np.float32]:
        """Returns the observations (R, n, D) of the environments `envs` (R,)."""
        flight, task = self.flight, self.task
        observation = np.empty((len(envs), flight.num_uavs, task.observation_size), np.float32)
        first = 0
        for part in task.observations:
            numbers = part.function(flight)[envs]
            if part.noise:
                shape = (flight.num_uavs, part.size)
                numbers = numbers + flight.draws.normal(envs, part.noise, shape)
            last = first + part.size
            observation[..., first:last] = np.clip(numbers / part.scale, -part.limit, part.limit)
            first = last
        return observation

    def get_state(self) -> dict[str, Any]:
        """Returns everything that changes, for `set_state`."""
        flight = self.flight
        return {
            "envs": self.envs.get_state(),
            "draws": flight.draws.get_state(),
            "values": {name: value.copy() for name, value in flight.values.items()},
            "actions": (flight.action.copy(), flight.previous_action.copy(), self._delayed.copy()),
            "decisions": flight.decisions.copy(),
            "returns": self.returns.copy(),
            "reward_sums": {name: sums.copy() for name, sums in self.reward_sums.items()},
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a state of `get_state` of this object."""
        flight = self.flight
        self.envs.set_state(state["envs"])
        flight.draws.set_state(state["draws"])
        flight.values.update({name: value.copy() for name, value in state["values"].items()})
        flight.action, flight.previous_action, self._delayed = (a.copy() for a in state["actions"])
        flight.decisions = state["decisions"].copy()
        self.returns = state["returns"].copy()
        self.reward_sums = {name: sums.copy() for name, sums in state["reward_sums"].items()}
        flight.refresh()

    def close(self) -> None:
        """Releases the environments."""
        self.envs.close()

    def _late(self, action: Array) -> Array:
        """Returns the action that takes effect now."""
        if not len(self._delayed):
            return action
        now: Array = self._delayed[0].copy()
        self._delayed[:-1] = self._delayed[1:]
        self._delayed[-1] = action
        return now


def _steps_of(task: Task, dt_ns: int) -> int:
    """Returns the physics steps of a decision."""
    period_ns = NS_PER_S / task.decision_rate_hz
    steps = round(period_ns / dt_ns)
    if steps < 1 or abs(steps * dt_ns - period_ns) > 1e-6 * period_ns:
        raise ScenarioError(
            f"task '{task.name}': decisions at {task.decision_rate_hz:g} Hz are not a whole number "
            f"of physics steps of {dt_ns / 1e6:g} ms"
        )
    return steps


def check_action(action: Any, shape: tuple[int, ...], choices: int | None) -> Array:
    """Returns an action as floats of `shape`; raises `CommandError` for one that is impossible.

    Continuous actions beyond -1 to 1 are clipped; choices must be whole numbers below `choices`.
    """
    try:
        array = np.asarray(action, np.float64)
    except (TypeError, ValueError):
        raise CommandError("actions must be numbers") from None
    if array.shape != shape:
        raise CommandError(f"actions have shape {shape}, not {array.shape}")
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        raise CommandError(f"action {where} is {array[tuple(where)]}; actions must be finite")
    if choices is None:
        return np.asarray(np.clip(array, -1.0, 1.0))
    if ((array < 0) | (array >= choices) | (array != np.floor(array))).any():
        raise CommandError(f"actions must be whole numbers from 0 to {choices - 1}")
    return array
