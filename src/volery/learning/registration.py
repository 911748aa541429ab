"""Registers the tasks with Gymnasium: `gymnasium.make("volery/Hover-v0")` and `make_vec`.

Tasks for teams have `make_vec` only, with a row for each UAV; see also `team_env.parallel_env`.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium

from volery.learning.single_env import TaskEnv
from volery.learning.tasks import TASKS, load_task
from volery.learning.vector_env import TaskVectorEnv


def register_tasks() -> None:
    """Registers all tasks that are not registered yet; also the plug-in of `gymnasium`."""
    for name in TASKS:
        identifier = f"volery/{name.title().replace('_', '')}-v0"
        if identifier not in gymnasium.registry:
            gymnasium.register(
                identifier,
                entry_point=partial(_single, name),
                vector_entry_point=partial(_many, name),
                max_episode_steps=None,
            )


def _single(task: str, **options: Any) -> TaskEnv:
    return TaskEnv(load_task(task), **options)


def _many(task: str, num_envs: int = 1, **options: Any) -> TaskVectorEnv:
    return TaskVectorEnv(load_task(task), num_envs, **options)
