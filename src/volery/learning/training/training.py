"""Trains and evaluates policies in one call, after a check that policy and task fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from volery.autonomy.policy.description import PolicyDescription
from volery.autonomy.policy.policy_file import Policy
from volery.autonomy.policy.shipped_policies import load_policy
from volery.core.errors import VoleryError
from volery.learning.policy_description import describe
from volery.learning.task import Task
from volery.learning.training.configuration import TrainingConfiguration, load_configuration
from volery.learning.training.evaluation import Evaluation, evaluate_actions
from volery.learning.training.task_loading import find_task
from volery.learning.training.trainer import Trainer, TrainingMonitor, TrainingResult


def train(
    task: str | Task,
    *,
    algorithm: str | None = None,
    seconds: float | None = None,
    steps: int | None = None,
    seed: int | None = None,
    num_envs: int | None = None,
    configuration: TrainingConfiguration | None = None,
    checkpoint: str | Path | None = None,
    monitors: Sequence[TrainingMonitor] = (),
) -> TrainingResult:
    """Trains a policy until it reaches the target of its configuration, or a limit.

    task: a shipped name, `module:function`, `file.py:function`, or a `Task`. configuration: the
    default is the shipped one of the task. checkpoint: file written for a later `--resume`. Raises
    `VoleryError` for an unknown task, or an algorithm that does not fit it.
    """
    found = find_task(task)
    chosen = (configuration or load_configuration(found.name)).changed(
        algorithm=algorithm, seconds=seconds, steps=steps, seed=seed, num_envs=num_envs
    )
    file = None if checkpoint is None else Path(checkpoint)
    trainer = Trainer(found, chosen, checkpoint=file, monitors=monitors)
    try:
        return trainer.run()
    finally:
        trainer.close()


def evaluate(
    policy: str | Path | Policy,
    *,
    task: str | Task | None = None,
    episodes: int = 200,
    seed: int = 0,
    threads: int = 2,
    on_decision: Callable[[int], None] | None = None,
) -> Evaluation:
    """Returns how a policy does in episodes of seeds on which none is trained.

    policy: a shipped name, a file, or a `Policy`. task: the default is the policy's own. Raises
    `VoleryError` if the policy does not fit the task.
    """
    own = policy if isinstance(policy, Policy) else load_policy(str(policy))
    found = find_task(own.description.task if task is None else task)
    _check_policy(own.description, found)
    return evaluate_actions(
        found, own.act, episodes, seed=seed, threads=threads, on_decision=on_decision
    )


def _check_policy(description: PolicyDescription, task: Task) -> None:
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
