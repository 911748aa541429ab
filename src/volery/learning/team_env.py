"""A task for a team as a `pettingzoo.ParallelEnv`; needs PettingZoo."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.spaces import Space
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from volery.core.errors import CommandError
from volery.core.extras import import_extra
from volery.learning.rendering import render_nothing
from volery.learning.spaces import action_space, observation_space
from volery.learning.task import Task
from volery.learning.tasks import load_task
from volery.learning.vector_env import TaskVectorEnv

_pettingzoo = import_extra("volery.learning.team_env", "pettingzoo", "pettingzoo", "learning")

Observation = NDArray[np.float32]


class TeamEnv(_pettingzoo.ParallelEnv):  # type: ignore[misc,name-defined]  # it has no type hints
    """One environment of a task; its agents are the UAVs that the policy flies, by name.

    An episode ends for all agents at once: when the task ends it for any of them, or at the time
    limit. Each agent has its own reward, and a crash costs only the UAV that crashes: it is
    terminated, and its teammates are truncated. For training with shared parameters,
    `TaskVectorEnv` has the agents of many environments as rows.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        self.metadata = {
            "name": f"volery_{task.name}_v0",
            "render_modes": [],
            "is_parallelizable": True,
            "render_fps": round(task.decision_rate_hz),
        }
        self.render_mode = None
        self._rows = TaskVectorEnv(task, 1, autoreset_mode=AutoresetMode.DISABLED, threads=1)
        names = self._rows.episodes.envs.uav_names
        self.possible_agents = list(names[: task.num_agents])
        self.agents: list[str] = []
        self._has_begun = False
        self.observation_spaces = {name: observation_space(task) for name in self.possible_agents}
        self.action_spaces = {name: action_space(task) for name in self.possible_agents}

    def observation_space(self, agent: str) -> Space[Any]:
        """Returns the space of observations (D,) of `agent`, always the same object."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Space[Any]:
        """Returns the space of actions (A,) of `agent`, always the same object."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Begins an episode with all agents; returns their observations (D,) and empty infos.

        seed: of the environment; None continues its random stream. There are no `options`.
        """
        del options
        rows, _ = self._rows.reset(seed=seed)
        self.agents = list(self.possible_agents)
        self._has_begun = True
        return self._by_agent(rows), {name: {} for name in self.agents}

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[
        dict[str, Observation],
        dict[str, float],
        dict[str, bool],
        dict[str, bool],
        dict[str, dict[str, Any]],
    ]:
        """Acts and returns observations, rewards, terminated, truncated and infos by agent.

        The last infos of an episode have `success` and the sums `reward_terms`. Raises
        `CommandError` for actions that are missing or impossible, and without an episode; after
        an episode, no actions of no agents have no results, as in PettingZoo's environments.
        """
        if not self.agents and not actions and self._has_begun:
            return {}, {}, {}, {}, {}
        if not self.agents:
            raise CommandError("no episode is running; call reset()")
        if set(actions) != set(self.agents):
            raise CommandError(
                f"actions of {', '.join(self.agents)} are needed, not of "
                f"{', '.join(map(str, actions)) or 'none'}"
            )
        taken = [np.asarray(actions[name]) for name in self.possible_agents]
        for name, action in zip(self.possible_agents, taken, strict=True):
            wanted = self.action_spaces[name].shape
            if action.shape != wanted:
                raise CommandError(f"the action of {name} has shape {wanted}, not {action.shape}")
        rows, rewards, terminated, truncated, info = self._rows.step(np.array(taken))
        own: dict[str, dict[str, Any]] = {name: {} for name in self.agents}
        if "success" in info:
            for k, name in enumerate(self.agents):
                own[name]["success"] = bool(info["success"][k])
                terms = info["reward_terms"].items()
                own[name]["reward_terms"] = {term: float(sums[k]) for term, sums in terms}
        result = (
            self._by_agent(rows),
            dict(zip(self.agents, rewards.tolist(), strict=True)),
            dict(zip(self.agents, terminated.tolist(), strict=True)),
            dict(zip(self.agents, truncated.tolist(), strict=True)),
            own,
        )
        if (terminated | truncated).all():
            self.agents = []
        return result

    def render(self) -> None:
        """Warns that there is no image."""
        render_nothing()

    def close(self) -> None:
        """Releases the simulation."""
        self._rows.close()

    def _by_agent(self, rows: Observation) -> dict[str, Observation]:
        return dict(zip(self.possible_agents, rows, strict=True))


def parallel_env(task: str) -> TeamEnv:
    """Returns the environment of a task by name: `parallel_env("formation")`.

    Raises `ScenarioError` for an unknown task.
    """
    return TeamEnv(load_task(task))
