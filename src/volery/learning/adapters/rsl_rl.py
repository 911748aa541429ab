"""A task as a `VecEnv` of rsl-rl; install that library yourself: `pip install rsl-rl-lib`."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from volery.core.errors import CommandError, ScenarioError, VoleryError
from volery.learning.vector_env import TaskVectorEnv

try:
    import torch
    from tensordict import TensorDict
except ImportError as error:
    raise VoleryError(f"rsl-rl needs {error.name}: pip install rsl-rl-lib") from None

GROUP = "policy"
"""Name of the group of observations; give `obs_groups = {"actor": ["policy"], ...}`."""


class RslRlEnv:
    """Steps all environments of a `TaskVectorEnv` in compiled calls, for runners of rsl-rl.

    Observations are a `TensorDict` with one group, `policy`. Extras have `time_outs`, and in steps
    that end episodes `log` with the fraction of successes and the mean sum of each reward term.
    Raises `ScenarioError` for discrete actions, and unless `envs` resets in the same step.

    device: of the tensors, such as "cpu" or "cuda:0".
    """

    def __init__(self, envs: TaskVectorEnv, *, device: str = "cpu") -> None:
        if envs.autoreset_mode != AutoresetMode.SAME_STEP:
            raise ScenarioError(
                'rsl-rl resets in the same step: make the environments with "SameStep"'
            )
        if envs.task.action.choices is not None:
            raise ScenarioError(
                f"task '{envs.task.name}' has discrete actions; rsl-rl needs others"
            )
        self.envs = envs
        self.device = torch.device(device)
        self.num_envs = envs.num_envs
        self.num_actions = envs.task.action.size
        self.max_episode_length = envs.task.episode_decisions
        self.cfg: dict[str, Any] = {"task": envs.task.name}
        self._observations = self._grouped(envs.reset()[0])

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """(K * m,) decisions since the start of each episode."""
        decisions = self.envs.episodes.flight.decisions
        return self._tensor(np.repeat(decisions, self.envs.task.num_agents))

    @episode_length_buf.setter
    def episode_length_buf(self, _value: torch.Tensor) -> None:
        """Raises `CommandError`: an episode's time belongs to its motion."""
        raise CommandError(
            "episodes cannot begin in their middle: call learn(init_at_random_ep_len=False)"
        )

    def get_observations(self) -> TensorDict:
        """Returns the present observations (K * m, D)."""
        return self._observations

    def reset(self, *, seed: int | None = None) -> TensorDict:
        """Begins new episodes in all environments; returns their observations."""
        self._observations = self._grouped(self.envs.reset(seed=seed)[0])
        return self._observations

    def step(
        self, actions: torch.Tensor
    ) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, Any]]:
        """Acts (K * m, A); returns observations, rewards, ends (K * m,) and extras."""
        observation, reward, terminated, truncated, info = self.envs.step(
            actions.detach().cpu().numpy()
        )
        self._observations = self._grouped(observation)
        over = terminated | truncated
        extras: dict[str, Any] = {"time_outs": self._tensor(truncated)}
        if over.any():
            extras["log"] = {
                "/success": float(info["success"][over].mean()),
                **{f"/{name}": float(v[over].mean()) for name, v in info["reward_terms"].items()},
            }
        rewards = self._tensor(reward.astype(np.float32))
        return self._observations, rewards, self._tensor(over), extras

    def close(self) -> None:
        """Releases the simulation."""
        self.envs.close()

    def _grouped(self, observation: np.ndarray) -> TensorDict:
        return TensorDict(
            {GROUP: self._tensor(observation)}, batch_size=[self.num_envs], device=self.device
        )

    def _tensor(self, values: np.ndarray) -> torch.Tensor:
        return torch.as_tensor(values, device=self.device)
