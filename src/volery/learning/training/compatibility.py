"""Checks that a policy fits a task."""

from __future__ import annotations

from volery.autonomy.policy.description import PolicyDescription
from volery.core.errors import VoleryError
from volery.learning.policy_description import describe
from volery.learning.task import Task


def check_policy(description: PolicyDescription, task: Task) -> None:
    """Raises `VoleryError` if observations, actions or decision rate differ from the task's."""
    wrong = f"the policy is of task '{description.task}' and does not fit task '{task.name}'"
    its = [(part.name, part.numbers) for part in description.observation]
    own = [(part.name, part.numbers) for part in describe(task).observation]
    if its != own:
        raise VoleryError(f"{wrong}: it observes {_parts(its)}; the task has {_parts(own)}")
    action = description.action
    if (action.size, action.choices) != (task.action.size, task.action.choices):
        raise VoleryError(
            f"{wrong}: its actions have {_action(action.size, action.choices)}; "
            f"those of the task {_action(task.action.size, task.action.choices)}"
        )
    if description.decision_rate_hz != task.decision_rate_hz:
        raise VoleryError(
            f"{wrong}: it decides at {description.decision_rate_hz:g} Hz, the task at "
            f"{task.decision_rate_hz:g} Hz"
        )


def _parts(parts: list[tuple[str, int]]) -> str:
    return ", ".join(f"{name} ({size})" for name, size in parts)


def _action(size: int, choices: int | None) -> str:
    return f"{size} numbers" if choices is None else f"{choices} choices"
