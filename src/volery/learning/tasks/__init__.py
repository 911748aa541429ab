"""The tasks that ship with Volery, one file each; `TASKS` lists them by name."""

from __future__ import annotations

from collections.abc import Callable

from volery.core.errors import ScenarioError
from volery.learning.task import Task
from volery.learning.tasks.homing import homing
from volery.learning.tasks.hover import hover

TASKS: dict[str, Callable[[], Task]] = {"hover": hover, "homing": homing}


def load_task(name: str) -> Task:
    """Returns a task by name. Raises `ScenarioError` for an unknown one."""
    if name not in TASKS:
        raise ScenarioError(f"unknown task '{name}'; known: {', '.join(TASKS)}")
    return TASKS[name]()
