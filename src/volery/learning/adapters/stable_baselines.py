"""A task as a `VecEnv` of stable-baselines3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from volery.core.arrays import Array
from volery.learning.task import Task
from volery.learning.vector_env import TaskVectorEnv


class StableBaselinesEnv(VecEnv):
    """Steps `num_envs` environments of a task for stable-baselines3.

    Infos of ended episodes have `episode` (return `r`, decisions `l`), `is_success`,
    `terminal_observation` and `TimeLimit.truncated`; all others are empty.
    """

    def __init__(self, task: Task, num_envs: int, *, threads: int = 2) -> None:
        self.env = TaskVectorEnv(
            task, num_envs, autoreset_mode=AutoresetMode.SAME_STEP, threads=threads
        )
        self._actions: Array = np.zeros(0)
        self._seed: int | None = None
        super().__init__(num_envs, self.env.single_observation_space, self.env.single_action_space)

    def reset(self) -> VecEnvObs:
        """Begins new episodes; returns observations (K, D)."""
        observation, _ = self.env.reset(seed=self._seed)
        self._seed = None
        return observation

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Sets the seed of environment 0 for the next reset; environment k has `seed + k`."""
        self._seed = seed
        return [None if seed is None else seed + k for k in range(self.num_envs)]

    def step_async(self, actions: Array) -> None:
        """Stores the actions (K, A) of the next `step_wait`."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Steps; returns observations, rewards, whether episodes have ended, and infos."""
        observation, reward, terminated, truncated, info = self.env.step(self._actions)
        over = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for k in np.flatnonzero(over).tolist():
            infos[k] = {
                "episode": {"r": float(info["episode"]["r"][k]), "l": int(info["episode"]["l"][k])},
                "is_success": bool(info["success"][k]),
                "terminal_observation": info["final_obs"][k],
                "TimeLimit.truncated": bool(truncated[k]),
            }
        return observation, reward.astype(np.float32), over, infos

    def close(self) -> None:
        """Releases the simulation."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Returns an attribute of the vector environment for each of `indices`."""
        return [getattr(self.env, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Sets an attribute of the vector environment, common to all environments."""
        del indices
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *args: Any, indices: VecEnvIndices = None, **options: Any
    ) -> list[Any]:
        """Calls a method of the vector environment once; returns its result for each index."""
        result = getattr(self.env, method_name)(*args, **options)
        return [result] * len(list(self._get_indices(indices)))

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        """Returns False for each of `indices`: environments have no wrappers."""
        del wrapper_class
        return [False] * len(list(self._get_indices(indices)))
