"""A task as a `gymnasium.vector.VectorEnv`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from volery.core.arrays import Array
from volery.core.errors import CommandError, ScenarioError
from volery.learning.episodes import Episodes, Outcome, check_action
from volery.learning.rendering import render_nothing
from volery.learning.spaces import action_space, observation_space
from volery.learning.task import Task

Observations = NDArray[np.float32]
_LARGEST_SEED = 2**62
_NEEDS_RESET = "the episodes of environments {} have ended; reset them"


class TaskVectorEnv(VectorEnv[Observations, Array, Any]):
    """Steps `num_envs` environments of a task in compiled calls, with a row for each UAV.

    For a team of m UAVs with shared parameters, the attribute `num_envs` is the number of rows, m
    for each environment. All rows of an environment end together: where one UAV causes the end, its
    row is terminated, and those of its teammates are truncated, as by the time limit.

    autoreset_mode: "SameStep" (the default: a step that ends an episode returns the first
    observation of the next one, and the last one as `info["final_obs"]`), "NextStep" or "Disabled"
    (reset with `options={"reset_mask": mask}`). Environment k has the seed `seed + k`. Results do
    not depend on `threads`, and an environment equals a single one with its seed.
    """

    def __init__(
        self,
        task: Task,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        threads: int = 2,
    ) -> None:
        if num_envs < 1:
            raise ScenarioError(f"num_envs = {num_envs}: at least 1 is needed")
        self.task = task
        self.num_envs = num_envs * task.num_agents
        self._num_teams, self._threads = num_envs, threads
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {"autoreset_mode": self.autoreset_mode, "render_modes": []}
        self.single_observation_space = observation_space(task)
        self.single_action_space = action_space(task)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.episodes = Episodes(task, num_envs, threads=threads)
        self._ends = np.array([*(end.name for end in task.terminations), "time_limit"])
        self._is_over = np.ones(num_envs, np.bool_)
        """(K,) environments, not rows."""
        self._has_begun = False
        self._observation = np.zeros((num_envs, task.num_agents, task.observation_size), np.float32)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Begins new episodes; returns observations (K * m, D) and an empty info.

        seed: of environment 0; environment k has `seed + k`. None continues the random streams.
        options: `reset_mask` (K * m,) chooses the environments; the others keep their observations.
        """
        self._check_open()
        chosen = self._chosen(options)
        self._seed(seed, chosen)
        self.episodes.begin(chosen)
        self._is_over[chosen] = False
        self._has_begun = True
        self._renew(chosen)
        return self._seen(), {}

    def step(
        self, actions: ArrayLike
    ) -> tuple[Observations, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Acts (K * m, A) and returns observations, rewards, terminated, truncated and info.

        Of the episodes that end with this step, `info["episode_return"]` has the sum of rewards,
        `info["episode_length"]` the number of decisions, `info["success"]` whether they succeed,
        `info["end"]` the number of the termination (or their count: the time limit),
        `info["end_name"]` its name ("time_limit"), and `info["reward_terms"]` the sums of each
        term; the mask `_end` (K * m,), like that of each other key, says which they are. The key
        `episode` is left to Gymnasium's `RecordEpisodeStatistics`. Raises `CommandError` for an
        action of a wrong shape or one that is not finite, and for an environment that needs a
        reset.
        """
        self._check_open()
        if not self._has_begun:
            raise CommandError("call reset() before the first step")
        action = self._checked(actions)
        resting = self._is_over
        if resting.any() and self.autoreset_mode != AutoresetMode.NEXT_STEP:
            raise CommandError(_NEEDS_RESET.format(np.flatnonzero(self._is_over).tolist()))
        outcome = self.episodes.decide(action)
        reward = outcome.reward[:, : self.task.num_agents]
        over = (outcome.terminated | outcome.truncated) & ~resting
        if resting.any():
            reward[resting] = 0.0
        terminated = outcome.ended[:, : self.task.num_agents] & over[:, None]
        truncated = over[:, None] & ~terminated
        info = self._info(outcome, over) if over.any() else {}
        if resting.any():
            self.episodes.begin(np.flatnonzero(resting))
        self._renew(np.arange(len(over)))
        self._is_over = over
        if self.autoreset_mode == AutoresetMode.SAME_STEP and over.any():
            self._begin_at_once(over, info)
        ends = terminated.reshape(-1), truncated.reshape(-1)
        return self._seen(), reward.reshape(-1), *ends, info

    def get_state(self) -> dict[str, Any]:
        """Returns everything that changes, for `set_state` of an environment made alike."""
        return {
            "episodes": self.episodes.get_state(),
            "over": self._is_over.copy(),
            "observation": self._observation.copy(),
        }

    def set_state(self, state: dict[str, Any], envs: NDArray[np.int64] | None = None) -> None:
        """Restores a state of `get_state`, taken after the first reset.

        envs: numbers (R,) of the environments that are restored, while the others go on; None: all.
        Raises `CommandError` for a part if the scenario has sensors.
        """
        self._check_open()
        self.episodes.set_state(state["episodes"], envs)
        rows = slice(None) if envs is None else envs
        self._is_over[rows] = state["over"][rows]
        self._observation[rows] = state["observation"][rows]
        self._has_begun = True

    def __reduce__(self) -> tuple[Any, ...]:
        """Returns how to make the same environments, with their state, for `pickle`."""
        state = self.get_state() if self._has_begun else None
        return _remade, (self.task, self._num_teams, self.autoreset_mode, self._threads, state)

    def render(self) -> None:
        """Warns that there is no image."""
        render_nothing()

    def close_extras(self, **_: Any) -> None:
        """Releases the simulation."""
        self.episodes.close()

    # ------------------------------------------------------------------------------------- inside

    def _begin_at_once(self, over: NDArray[np.bool_], info: dict[str, Any]) -> None:
        info["final_obs"], info["_final_obs"] = self._seen(), self._rows(over)
        chosen = np.flatnonzero(over)
        self.episodes.begin(chosen)
        self._renew(chosen)
        self._is_over = np.zeros(len(over), np.bool_)

    def _renew(self, envs: NDArray[np.int64]) -> None:
        self._observation[envs] = self.episodes.observe(envs)

    def _seen(self) -> Observations:
        """Returns a copy of the observations, (K * m, D)."""
        return self._observation.reshape(self.num_envs, -1).copy()

    def _rows(self, values: NDArray[Any]) -> NDArray[Any]:
        """Returns values (K,) of the environments for their rows, (K * m,)."""
        return np.repeat(values, self.task.num_agents)

    def _info(self, outcome: Outcome, over: NDArray[np.bool_]) -> dict[str, Any]:
        episodes, agents, ends = self.episodes, self.task.num_agents, self._rows(over)
        sums = {name: own[:, :agents].reshape(-1) for name, own in episodes.reward_sums.items()}
        return {
            "episode_return": np.where(ends, episodes.returns[:, :agents].reshape(-1), 0.0),
            "_episode_return": ends,
            "episode_length": self._rows(np.where(over, episodes.flight.decisions, 0)),
            "_episode_length": ends,
            "success": self._rows(outcome.success & over),
            "_success": ends,
            "end": self._rows(np.where(over, outcome.end, -1)),
            "_end": ends,
            "end_name": self._rows(np.where(over, self._ends[outcome.end], "")),
            "_end_name": ends,
            "reward_terms": {name: np.where(ends, own, 0.0) for name, own in sums.items()},
            "_reward_terms": ends,
        }

    def _check_open(self) -> None:
        if self.closed:
            raise CommandError("the environments are closed; make new ones")

    def _checked(self, actions: ArrayLike) -> Array:
        choices = self.task.action.choices
        size = self.task.action.size
        shape = (self.num_envs,) if choices is not None else (self.num_envs, size)
        return check_action(actions, shape, choices).reshape(-1, self.task.num_agents, size)

    def _chosen(self, options: dict[str, Any] | None) -> NDArray[np.int64]:
        mask = (options or {}).get("reset_mask")
        agents = self.task.num_agents
        if mask is None:
            return np.arange(self.num_envs // agents)
        mask = np.asarray(mask)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise CommandError(f"reset_mask: {self.num_envs} booleans are needed, not {mask!r}")
        teams = mask.reshape(-1, agents)
        if (teams.any(axis=1) != teams.all(axis=1)).any():
            raise CommandError(f"reset_mask: the {agents} rows of an environment reset together")
        return np.flatnonzero(teams[:, 0])

    def _seed(self, seed: int | Sequence[int | None] | None, chosen: NDArray[np.int64]) -> None:
        if seed is None:
            return
        envs = self.num_envs // self.task.num_agents
        seeds: list[Any] = list(seed) if isinstance(seed, list | tuple) else [seed]
        if isinstance(seed, int | np.integer) and _is_seed(seed):
            seeds = list(range(int(seed), int(seed) + envs))
        for one in seeds:
            if one is not None and not _is_seed(one):
                raise CommandError(
                    f"seed = {one!r}: a whole number from 0 on, up to 2^62, is needed"
                )
        if len(seeds) != envs:
            raise CommandError(f"{len(seeds)} seeds for {envs} environments")
        rows = np.array([k for k in chosen.tolist() if seeds[k] is not None], np.int64)
        self.episodes.seed(np.array([seeds[k] for k in rows.tolist()], np.int64), rows)


def _is_seed(seed: object) -> bool:
    return isinstance(seed, int | np.integer) and 0 <= int(seed) <= _LARGEST_SEED


def _remade(
    task: Task, num_envs: int, mode: AutoresetMode, threads: int, state: dict[str, Any] | None
) -> TaskVectorEnv:
    env = TaskVectorEnv(task, num_envs, autoreset_mode=mode, threads=threads)
    if state is not None:
        env.set_state(state)
    return env
