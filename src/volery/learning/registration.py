"""Registers the tasks with Gymnasium: `gymnasium.make("volery/Hover-v0")` and `make_vec`.

Tasks for teams have `make_vec` only, with a row for each UAV; see also `team_env.parallel_env`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium

from volery.core.errors import ScenarioError
from volery.learning.rendering import refuse_rendering
from volery.learning.single_env import TaskEnv
from volery.learning.task import Task
from volery.learning.tasks import TASKS, load_task
from volery.learning.vector_env import TaskVectorEnv


def register_tasks() -> None:
    """Registers all tasks that are not registered yet; also the plug-in of `gymnasium`."""
    for name in TASKS:
        identifier = f"volery/{name.title().replace('_', '')}-v0"
        if identifier not in gymnasium.registry:
            gymnasium.register(
                identifier,
                entry_point=f"{__name__}:make_single",
                vector_entry_point=f"{__name__}:make_many",
                kwargs={"task": name},
                max_episode_steps=None,
            )


def make_single(task: str, *, render_mode: str | None = None, **options: Any) -> TaskEnv:
    """Returns one environment of a task for `gymnasium.make`; options are those of `TaskEnv`.

    Raises `RenderingError` for a `render_mode` other than None.
    """
    refuse_rendering(render_mode)
    return TaskEnv(load_task(task), **options)


def make_many(
    task: str,
    num_envs: int = 1,
    *,
    render_mode: str | None = None,
    max_episode_steps: int | None = None,
    **options: Any,
) -> TaskVectorEnv:
    """Returns environments for `gymnasium.make_vec`; options are those of `TaskVectorEnv`.

    max_episode_steps: of decisions, at most those of the task. Raises `RenderingError`
    for a `render_mode` other than None, and `ScenarioError` for an episode without decisions.
    """
    refuse_rendering(render_mode)
    chosen = load_task(task)
    if max_episode_steps is not None:
        chosen = shortened_task(task, max_episode_steps)
    return TaskVectorEnv(chosen, num_envs, **options)


def shortened_task(name: str, max_episode_steps: int) -> Task:
    """Returns a task with episodes of at most `max_episode_steps` decisions.

    Raises `ScenarioError` if that is none.
    """
    if max_episode_steps < 1:
        raise ScenarioError(f"max_episode_steps = {max_episode_steps}: at least 1 is needed")
    task = load_task(name)
    episode_s = min(task.episode_s, max_episode_steps / task.decision_rate_hz)
    shortened = replace(task, episode_s=episode_s)
    return shortened.made_by(shortened_task, name, max_episode_steps)
