"""A task as a `gymnasium.Env`: one environment of the vectorized one."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from volery.core.arrays import Array
from volery.core.errors import CommandError, ScenarioError
from volery.learning.rendering import render_nothing
from volery.learning.spaces import action_space, observation_space
from volery.learning.task import Task
from volery.learning.vector_env import TaskVectorEnv


class TaskEnv(gymnasium.Env[NDArray[np.float32], Array]):
    """One environment of a task; see `TaskVectorEnv` for many in one call, which is faster."""

    def __init__(self, task: Task) -> None:
        if task.num_agents != 1:
            raise ScenarioError(
                f"task '{task.name}' is for a team of {task.num_agents} UAVs; use "
                f'volery.learning.team_env.parallel_env("{task.name}"), or TaskVectorEnv'
            )
        self.task = task
        self.metadata = {"render_modes": [], "render_fps": round(task.decision_rate_hz)}
        self.observation_space = observation_space(task)  # type: ignore[assignment]
        self.action_space = action_space(task)  # type: ignore[assignment]
        self._many = TaskVectorEnv(task, 1, autoreset_mode=AutoresetMode.DISABLED, threads=1)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begins a new episode; returns the observation (D,) and an empty info."""
        super().reset(seed=seed)
        observation, info = self._many.reset(seed=seed, options=options)
        return observation[0], info

    def step(
        self, action: ArrayLike
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Acts (A,) and returns observation (D,), reward, terminated, truncated and info.

        The last step of an episode has `info["success"]`, the name `info["end_name"]` of what ended
        it ("time_limit" or a termination's) and the sums `info["reward_terms"]`.
        """
        chosen = np.asarray(action)
        if chosen.shape != self.action_space.shape:
            raise CommandError(f"an action has shape {self.action_space.shape}, not {chosen.shape}")
        observation, reward, terminated, truncated, info = self._many.step(chosen[None])
        own: dict[str, Any] = {}
        if "success" in info:
            own["success"] = bool(info["success"][0])
            own["end_name"] = str(info["end_name"][0])
            own["reward_terms"] = {k: float(v[0]) for k, v in info["reward_terms"].items()}
        return observation[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), own

    def render(self) -> None:
        """Warns that there is no image."""
        render_nothing()

    def __repr__(self) -> str:
        return f"<TaskEnv '{self.task.name}'>"

    def __reduce__(self) -> tuple[Any, ...]:
        """Returns how to make the same environment, with its state, for `pickle`."""
        return _remade, (self.task, self._many)

    def close(self) -> None:
        """Releases the simulation."""
        self._many.close()


def _remade(task: Task, many: TaskVectorEnv) -> TaskEnv:
    env = TaskEnv(task)
    env._many.close()
    env._many = many
    return env
