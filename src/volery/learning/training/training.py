"""Trains and evaluates policies in one call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from volery.autonomy.policy.policy_file import Policy
from volery.autonomy.policy.shipped_policies import load_policy
from volery.learning.task import Task
from volery.learning.training.compatibility import check_policy
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
    check_policy(own.description, found)
    return evaluate_actions(
        found, own.act, episodes, seed=seed, threads=threads, on_decision=on_decision
    )
