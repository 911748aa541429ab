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
from volery.learning.spaces import action_space, observation_space
from volery.learning.task import Task

Observations = NDArray[np.float32]
_NEEDS_RESET = "the episodes of environments {} have ended; reset them"


class TaskVectorEnv(VectorEnv[Observations, Array, Any]):
    """Steps `num_envs` environments of a task with one UAV each in compiled calls.

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
        self.task = task
        self.num_envs = num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {"autoreset_mode": self.autoreset_mode, "render_modes": []}
        self.single_observation_space = observation_space(task)
        self.single_action_space = action_space(task)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.episodes = Episodes(task, num_envs, threads=threads)
        if self.episodes.flight.num_uavs != 1:
            self.episodes.close()
            raise ScenarioError(
                f"task '{task.name}' has {self.episodes.flight.num_uavs} UAVs; environments of "
                "Gymnasium have one"
            )
        self._is_over = np.ones(num_envs, np.bool_)
        self._has_begun = False
        self._observation = np.zeros((num_envs, task.observation_size), np.float32)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Begins new episodes; returns observations (K, D) and an empty info.

        seed: of environment 0; environment k has `seed + k`. None continues the random streams.
        options: `reset_mask` (K,) chooses the environments; the others keep their observations.
        """
        self._check_open()
        chosen = self._chosen(options)
        self._seed(seed, chosen)
        self.episodes.begin(chosen)
        self._is_over[chosen] = False
        self._has_begun = True
        self._renew(chosen)
        return self._observation.copy(), {}

    def step(
        self, actions: ArrayLike
    ) -> tuple[Observations, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Acts (K, A) and returns observations, rewards, terminated, truncated (K,) and info.

        Of the episodes that end with this step, `info["episode"]` has return `r` and decisions `l`,
        `info["success"]` whether they succeed, and `info["reward_terms"]` the sums of each term;
        the mask `_episode` (K,) says which they are. Raises `CommandError` for an action of a wrong
        shape or one that is not finite, and for an environment that needs a reset.
        """
        self._check_open()
        if not self._has_begun:
            raise CommandError("call reset() before the first step")
        action = self._checked(actions)
        resting = self._is_over
        if resting.any() and self.autoreset_mode != AutoresetMode.NEXT_STEP:
            raise CommandError(_NEEDS_RESET.format(np.flatnonzero(self._is_over).tolist()))
        outcome = self.episodes.decide(action)
        reward = outcome.reward[:, 0]
        terminated, truncated = outcome.terminated, outcome.truncated
        if resting.any():
            reward[resting] = 0.0
            terminated, truncated = terminated & ~resting, truncated & ~resting
        over = terminated | truncated
        info = self._info(outcome, over) if over.any() else {}
        if resting.any():
            self.episodes.begin(np.flatnonzero(resting))
        self._renew(np.arange(self.num_envs))
        self._is_over = over
        if self.autoreset_mode == AutoresetMode.SAME_STEP and over.any():
            self._begin_at_once(over, info)
        return self._observation.copy(), reward, terminated, truncated, info

    def close_extras(self, **_: Any) -> None:
        """Releases the simulation."""
        self.episodes.close()

    # ------------------------------------------------------------------------------------- inside

    def _begin_at_once(self, over: NDArray[np.bool_], info: dict[str, Any]) -> None:
        info["final_obs"], info["_final_obs"] = self._observation.copy(), over
        chosen = np.flatnonzero(over)
        self.episodes.begin(chosen)
        self._renew(chosen)
        self._is_over = np.zeros(self.num_envs, np.bool_)

    def _renew(self, envs: NDArray[np.int64]) -> None:
        self._observation[envs] = self.episodes.observe(envs)[:, 0]

    def _info(self, outcome: Outcome, over: NDArray[np.bool_]) -> dict[str, Any]:
        episodes = self.episodes
        return {
            "episode": {
                "r": np.where(over, episodes.returns[:, 0], 0.0),
                "l": np.where(over, episodes.flight.decisions, 0),
            },
            "_episode": over,
            "success": outcome.success & over,
            "_success": over,
            "reward_terms": {
                name: np.where(over, sums[:, 0], 0.0) for name, sums in episodes.reward_sums.items()
            },
            "_reward_terms": over,
        }

    def _check_open(self) -> None:
        if self.closed:
            raise CommandError("the environments are closed; make new ones")

    def _checked(self, actions: ArrayLike) -> Array:
        choices = self.task.action.choices
        size = self.task.action.size
        shape = (self.num_envs,) if choices is not None else (self.num_envs, size)
        return check_action(actions, shape, choices).reshape(self.num_envs, 1, size)

    def _chosen(self, options: dict[str, Any] | None) -> NDArray[np.int64]:
        mask = (options or {}).get("reset_mask")
        if mask is None:
            return np.arange(self.num_envs)
        mask = np.asarray(mask)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise CommandError(f"reset_mask: {self.num_envs} booleans are needed, not {mask!r}")
        return np.flatnonzero(mask)

    def _seed(self, seed: int | Sequence[int | None] | None, chosen: NDArray[np.int64]) -> None:
        if seed is None:
            return
        if not isinstance(seed, list | tuple) and not (
            isinstance(seed, int | np.integer) and seed >= 0
        ):
            raise CommandError(f"seed = {seed!r}: a whole number from 0 on is needed")
        seeds = (
            range(seed, seed + self.num_envs) if isinstance(seed, int | np.integer) else list(seed)
        )
        if len(seeds) != self.num_envs:
            raise CommandError(f"{len(seeds)} seeds for {self.num_envs} environments")
        rows = np.array([k for k in chosen.tolist() if seeds[k] is not None], np.int64)
        self.episodes.seed(np.array([seeds[k] for k in rows.tolist()], np.int64), rows)
