"""A task as a `VecEnv` of stable-baselines3."""

from __future__ import annotations

# ruff: noqa: ARG002  (methods of VecEnv whose arguments have no meaning here)
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices

from volery.core.errors import CommandError, ScenarioError
from volery.learning.vector_env import TaskVectorEnv

Info = dict[str, Any]
_ALONE = "the environments of a task are rows of one simulation; {} of single ones do not exist"


class StableBaselinesEnv(VecEnv):
    """Steps all environments of a `TaskVectorEnv` in compiled calls.

    The infos of environments whose episodes end have `terminal_observation`,
    `TimeLimit.truncated`, `episode` (return `r`, decisions `l`), `is_success` and `reward_terms`;
    all others share one empty info. Raises `ScenarioError` unless `envs` resets in the same step.

    marks_timeouts: whether infos have `TimeLimit.truncated`. Turn it off if a callback adds the
    values of observations at time limits itself, for all environments at once.
    """

    def __init__(
        self, envs: TaskVectorEnv, *, reward_scale: float = 1.0, marks_timeouts: bool = True
    ) -> None:
        if envs.autoreset_mode != AutoresetMode.SAME_STEP:
            raise ScenarioError(
                "stable-baselines3 resets in the same step: make the environments with "
                'autoreset_mode="SameStep"'
            )
        self.envs = envs
        self.reward_scale = reward_scale
        self.marks_timeouts = marks_timeouts
        self.last_info: Info = {}
        """Info of the last step, as arrays of all environments."""
        self.last_truncated = np.zeros(envs.num_envs, np.bool_)
        """Whether the last step truncated episodes (K,)."""
        self._empty: Info = {}
        self.last_actions: NDArray[Any] = np.zeros(0)
        """Actions (K, A) of the last step."""
        self.render_mode = None
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> NDArray[np.float32]:
        """Begins new episodes and returns observations (K, D); see `seed`."""
        seed = self._seeds[0] if self._seeds else None
        self._reset_seeds()
        self._reset_options()
        observation, _ = self.envs.reset(seed=seed)
        self.reset_infos = [self._empty] * self.num_envs
        return observation

    def step_async(self, actions: NDArray[Any]) -> None:
        """Stores the actions (K, A) of the next step."""
        self.last_actions = actions

    def step_wait(
        self,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], list[Info]]:
        """Steps and returns observations (K, D), rewards, ends (K,) and infos."""
        observation, reward, terminated, truncated, info = self.envs.step(self.last_actions)
        self.last_info, self.last_truncated = info, truncated
        over = terminated | truncated
        infos = [self._empty] * self.num_envs
        for k in np.flatnonzero(over).tolist():
            infos[k] = self._info_of(k, info, bool(truncated[k]))
        scaled = (self.reward_scale * reward).astype(np.float32)
        return observation, scaled, over, infos

    def close(self) -> None:
        """Releases the simulation."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Returns an attribute of the environments: the same for each."""
        return [getattr(self.envs, attr_name)] * len(self._rows(indices))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Raises `CommandError`: environments have no attributes of their own."""
        raise CommandError(_ALONE.format("attributes"))

    def env_method(
        self,
        method_name: str,
        *method_args: Any,
        indices: VecEnvIndices = None,
        **method_kwargs: Any,
    ) -> list[Any]:
        """Raises `CommandError`: environments have no methods of their own."""
        raise CommandError(_ALONE.format("methods"))

    def env_is_wrapped(self, wrapper_class: type[Any], indices: VecEnvIndices = None) -> list[bool]:
        """Returns that no environment is wrapped."""
        return [False] * len(self._rows(indices))

    def _info_of(self, k: int, info: Info, is_truncated: bool) -> Info:
        own: Info = {
            "terminal_observation": info["final_obs"][k],
            "episode": {"r": float(info["episode_return"][k]), "l": int(info["episode_length"][k])},
            "is_success": bool(info["success"][k]),
            "reward_terms": {name: float(v[k]) for name, v in info["reward_terms"].items()},
        }
        if self.marks_timeouts:
            own["TimeLimit.truncated"] = is_truncated
        return own

    def _rows(self, indices: VecEnvIndices) -> Sequence[int]:
        if indices is None:
            return range(self.num_envs)
        return [int(k) for k in indices] if isinstance(indices, Iterable) else [int(indices)]
