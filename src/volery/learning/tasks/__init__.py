"""The tasks that ship with Volery, one file each; `TASKS` lists them by name."""

from __future__ import annotations

from collections.abc import Callable

from volery.core.errors import ScenarioError
from volery.learning.task import Task
from volery.learning.tasks.forest import forest
from volery.learning.tasks.formation import formation
from volery.learning.tasks.gates import gates
from volery.learning.tasks.homing import homing
from volery.learning.tasks.hover import hover
from volery.learning.tasks.late_hover import late_hover
from volery.learning.tasks.pursuit import pursuit
from volery.learning.tasks.servoing import servoing, servoing_images
from volery.learning.tasks.tracking import tracking

TASKS: dict[str, Callable[[], Task]] = {
    "hover": hover,
    "late_hover": late_hover,
    "homing": homing,
    "forest": forest,
    "servoing": servoing,
    "tracking": tracking,
    "gates": gates,
    "formation": formation,
    "pursuit": pursuit,
}
EVALUATION_TASKS: dict[str, Callable[[], Task]] = {"servoing_images": servoing_images}
"""Tasks whose policies are trained in another one of `TASKS`: these are too slow for it."""


def load_task(name: str) -> Task:
    """Returns a task by name. Raises `ScenarioError` for an unknown one."""
    known = {**TASKS, **EVALUATION_TASKS}
    if name not in known:
        raise ScenarioError(f"unknown task '{name}'; known: {', '.join(known)}")
    return known[name]().made_by(load_task, name)
