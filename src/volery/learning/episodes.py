"""The episodes of a task in many environments: decisions, rewards, ends and new beginnings."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.policy.observation_terms import scaled
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError, ScenarioError
from volery.learning.curriculum import Levels
from volery.learning.flight import Flight
from volery.learning.signals import ActionPath, ObservationPath
from volery.learning.task import Task
from volery.runtime.environment_parameters import EnvironmentParameters
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
    end: NDArray[np.int64]
    """(K,) number of the termination that ended it; their count for the time limit, -1: no end."""
    ended: NDArray[np.bool_]
    """(K, n) UAVs for which the task ended it: all of them, or those that caused the end."""


class _Stop(NamedTuple):
    """A part of a decision, from `offset` physics steps after its start."""

    offset: int
    steps: int
    commands: bool
    """Whether actions take effect at its start."""
    records: tuple[ObservationPath, ...]
    """Observations that are recorded at its start."""


_OPEN = -1


class Episodes:
    """Runs the episodes of `task` in `num_envs` environments."""

    def __init__(self, task: Task, num_envs: int, *, seed: int = 0, threads: int = 2) -> None:
        self.task = task
        self.envs = VectorizedSimulation(
            task.scenario(),
            num_envs,
            seeds=[0] * num_envs,
            threads=threads,
            worlds=task.worlds or None,
        )
        try:
            self._steps = _steps_of(task, self.envs.dt_ns)
            _check_agents(task, len(self.envs.uav_names))
            self.flight = Flight(self.envs, task.action.size, task.decision_rate_hz)
            self.levels = Levels(task.curriculum, task.parameters, num_envs)
            """Levels of the task's curriculum."""
            self._actions = ActionPath(task, self.flight, self._steps)
            self._parts = [
                ObservationPath(part, self.flight, self._steps, task.num_agents)
                for part in task.observations
            ]
            self._paths: list[ActionPath | ObservationPath] = [self._actions, *self._parts]
        except ScenarioError:
            self.envs.close()
            raise
        _request_images(task, self.envs)
        self._stops = _stops(self._actions, self._parts, self._steps)
        shape = (num_envs, self.flight.num_uavs)
        for name, own in task.values.items():
            self.flight.values[name] = np.zeros((num_envs, *own))
        self.flight.parameters = self.levels.values
        for variation in task.randomization:
            self.flight.varied[variation.name] = np.zeros((*shape, variation.size))
        self._result = np.full(num_envs, _OPEN)
        """(K,) whether the present episode succeeded, once it has ended."""
        self.returns = np.zeros(shape)
        """(K, n) sums of rewards since the start of the episode."""
        self.reward_sums = {part.name: np.zeros(shape) for part in task.rewards}
        """(K, n) sums of each weighted reward, by name."""
        self.seed(np.arange(num_envs) + seed)

    def seed(self, seeds: NDArray[np.int64], envs: NDArray[np.int64] | None = None) -> None:
        """Restarts the random streams of `envs` (R,) (None: all) with `seeds` (R,)."""
        rows = np.arange(self.flight.num_envs) if envs is None else envs
        self.flight.draws.seed(rows, seeds)

    def begin(self, envs: NDArray[np.int64], *, worlds: NDArray[np.int64] | None = None) -> None:
        """Begins new episodes in the environments `envs` (R,).

        worlds: (R,) numbers of their worlds among those of the task; None draws them.
        """
        if not len(envs):
            return
        flight = self.flight
        ended = envs[self._result[envs] != _OPEN]
        self.levels.record(ended, self._result[ended] == 1)
        self.levels.begin(envs)
        self._result[envs] = _OPEN
        seeds = flight.draws.episode_seeds(envs)
        if worlds is None and len(self.envs.worlds) > 1:
            drawn = flight.draws.uniform(envs, 0.0, len(self.envs.worlds))
            worlds = np.minimum(drawn.astype(np.int64), len(self.envs.worlds) - 1)
        start = self.task.begin(flight, envs)
        self._vary(envs)
        self.envs.reset(envs, seeds, start=start, worlds=worlds)
        flight.refresh()
        flight.decisions[envs] = 0
        for array in (flight.action, flight.previous_action, self.returns):
            array[envs] = 0.0
        for path in self._paths:
            path.begin(envs)
        for sums in self.reward_sums.values():
            sums[envs] = 0.0

    def decide(self, action: Array) -> Outcome:
        """Acts, advances by one decision and returns its outcome; action: (K, m, A)."""
        flight, task = self.flight, self.task
        if task.script is not None:
            action = np.concatenate([action, task.script(flight)], axis=1)
        flight.previous_action, flight.action = flight.action, action
        self._actions.push(action)
        for stop in self._stops:
            self._advance(stop)
        self.envs.drain_events()
        flight.decisions += 1
        if task.advance is not None:
            task.advance(flight)
        reward = np.zeros((flight.num_envs, flight.num_uavs))
        for part in task.rewards:
            reward_part = part.weight * part.function(flight)
            self.reward_sums[part.name] += reward_part
            reward += reward_part
        terminated = np.zeros(flight.num_envs, np.bool_)
        success = np.zeros(flight.num_envs, np.bool_)
        end = np.full(flight.num_envs, -1)
        ended = np.zeros(reward.shape, np.bool_)
        for number, termination in enumerate(task.terminations):
            blame = termination.function(flight)
            blame = blame[:, None] if blame.ndim == 1 else blame
            ends = blame.any(axis=1) & ~terminated
            blame = blame & ends[:, None]
            reward += termination.reward * blame
            ended |= blame
            terminated |= ends
            end[ends] = number
            if termination.is_success:
                success |= ends
        truncated = (flight.decisions >= task.episode_decisions) & ~terminated
        end[truncated] = len(task.terminations)
        if task.success is not None and truncated.any():
            success |= truncated & task.success(flight)
        self.returns += reward
        new = (terminated | truncated) & (self._result == _OPEN)
        self._result[new] = success[new]
        return Outcome(reward, terminated, truncated, success, end, ended)

    def observe(self, envs: NDArray[np.int64]) -> NDArray[np.float32]:
        """Returns the observations (R, m, D) of the policy's UAVs in `envs` (R,)."""
        task, agents = self.task, self.task.num_agents
        observation = np.empty((len(envs), agents, task.observation_size), np.float32)
        first = 0
        for path in self._parts:
            part = path.part
            last = first + part.numbers
            observation[..., first:last] = scaled(path.observe(envs), part.scale, part.limit)
            first = last
        return observation

    def get_state(self) -> dict[str, Any]:
        """Returns everything that changes, for `set_state`."""
        flight = self.flight
        return {
            "envs": self.envs.get_state(),
            "draws": flight.draws.get_state(),
            "values": {name: value.copy() for name, value in flight.values.items()},
            "varied": {name: value.copy() for name, value in flight.varied.items()},
            "levels": self.levels.get_state(),
            "result": self._result.copy(),
            "actions": (flight.action.copy(), flight.previous_action.copy()),
            "paths": [path.get_state() for path in self._paths],
            "decisions": flight.decisions.copy(),
            "returns": self.returns.copy(),
            "reward_sums": {name: sums.copy() for name, sums in self.reward_sums.items()},
        }

    def set_state(self, state: dict[str, Any], envs: NDArray[np.int64] | None = None) -> None:
        """Restores a state of `get_state` of this object.

        envs: numbers (R,) of the environments that are restored, while the others go on; None: all.
        """
        flight = self.flight
        self.envs.set_state(state["envs"], envs)
        rows = slice(None) if envs is None else envs
        flight.draws.set_state(state["draws"], rows)
        self.levels.set_state(state["levels"], rows)
        flight.action, flight.previous_action = flight.action.copy(), flight.previous_action.copy()
        for mine, kept in (
            *((flight.values[name], value) for name, value in state["values"].items()),
            *((flight.varied[name], value) for name, value in state["varied"].items()),
            *zip((flight.action, flight.previous_action), state["actions"], strict=True),
            *((self.reward_sums[name], sums) for name, sums in state["reward_sums"].items()),
            (self._result, state["result"]),
            (flight.decisions, state["decisions"]),
            (self.returns, state["returns"]),
        ):
            mine[rows] = kept[rows]
        for path, kept in zip(self._paths, state["paths"], strict=True):
            path.set_state(kept, rows)
        flight.refresh()

    def _vary(self, envs: NDArray[np.int64]) -> None:
        """Draws the parameters of the episodes that begin in `envs` (R,)."""
        parameters = EnvironmentParameters()
        for variation in self.task.randomization:
            numbers = variation.draw(self.flight, envs)
            self.flight.varied[variation.name][envs] = numbers
            if variation.apply is not None:
                parameters = parameters.with_(variation.apply(self.flight, numbers))
        if any(value is not None for value in vars(parameters).values()):
            self.envs.set_parameters(envs, parameters)

    def _advance(self, stop: _Stop) -> None:
        if stop.offset:
            self.flight.refresh()
        for path in stop.records:
            path.record(stop.offset)
        if stop.commands:
            self.task.action.command(self.flight, self._actions.at(stop.offset))
        self.envs.step(stop.steps)
        self.flight.refresh()

    def close(self) -> None:
        """Releases the environments."""
        self.envs.close()


def _stops(actions: ActionPath, parts: Sequence[ObservationPath], steps: int) -> tuple[_Stop, ...]:
    """Returns the parts of a decision of `steps` physics steps."""
    offsets = sorted({*actions.offsets, *(o for path in parts for o in path.offsets)})
    return tuple(
        _Stop(
            first,
            last - first,
            first in actions.offsets,
            tuple(path for path in parts if first in path.offsets),
        )
        for first, last in itertools.pairwise([*offsets, steps])
    )


def _request_images(task: Task, envs: VectorizedSimulation) -> None:
    """Lets the cameras that observations use render the parts that these need, and no others."""
    parts: dict[str, list[Any]] = {}
    for observation in task.observations:
        if observation.image is not None:
            sensor, part = observation.image
            parts.setdefault(sensor, []).append(part)
    for uav in envs.uav_names:
        for sensor, wanted in parts.items():
            envs.sensors[uav][sensor].request_parts(wanted)


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


def _check_agents(task: Task, num_uavs: int) -> None:
    """Raises `ScenarioError` unless each UAV is flown by the policy or by the task's script."""
    flown = task.num_agents if task.script is None else num_uavs - 1
    if not 1 <= task.num_agents <= flown or (task.script is None and flown != num_uavs):
        script = "without a script" if task.script is None else "beside its script"
        raise ScenarioError(
            f"task '{task.name}' has {num_uavs} UAVs and num_agents = {task.num_agents} {script}; "
            "each UAV needs one of them"
        )


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
