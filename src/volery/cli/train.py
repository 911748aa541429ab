"""`volery train`: trains a policy, shows the progress and writes a folder."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from volery.cli.interrupt import StopSignals, stopped_how
from volery.cli.terminal import echo_line


def train_and_write(
    name: str,
    options: dict[str, Any],
    *,
    out: Path | None,
    resume: bool,
    config: Path | None,
    tensorboard: bool,
) -> None:
    """Trains, writes policy, record and checkpoint, and prints where they are.

    options: values of the configuration; None keeps the configuration's.
    """
    from volery.learning.training.checkpoint import check_task, read_checkpoint
    from volery.learning.training.configuration import TrainingConfiguration, load_configuration
    from volery.learning.training.output_folder import last_folder, new_folder
    from volery.learning.training.progress import TrainingProgress
    from volery.learning.training.task_loading import find_task
    from volery.learning.training.trainer import Trainer, TrainingMonitor

    task = find_task(name)
    if resume:
        folder = last_folder(task.name, out)
        checkpoint = read_checkpoint(folder.checkpoint)
        check_task(checkpoint, task.name, folder.checkpoint)
        configuration = TrainingConfiguration.model_validate(checkpoint.configuration)
    else:
        folder = new_folder(task.name, out)
        configuration = load_configuration(task.name, config)
    configuration = configuration.changed(**options)
    monitors: list[TrainingMonitor] = [TrainingProgress()]
    folder.create()
    if tensorboard:
        from volery.learning.training.tensorboard_log import TensorBoardLog

        monitors.append(TensorBoardLog(folder.tensorboard))
    trainer = Trainer(task, configuration, checkpoint=folder.checkpoint, monitors=monitors)
    try:
        if resume:
            trainer.resume(folder.checkpoint)
        with _interruption(trainer):
            result = trainer.run()
        folder.write(result)
    finally:
        trainer.close()
    echo_line(
        f"{folder.policy}: success {result.success:.1%} in {configuration.evaluation_episodes} "
        f"episodes after {result.steps:,} steps, {result.seconds:.1f} s"
    )
    if result.ending != "target":
        echo_line(_advice(result.ending, f"volery train {name} --resume --out {folder.folder}"))


def _advice(ending: str, command: str) -> str:
    """Returns why a training ended early, and how to continue it."""
    if ending == "interrupted":
        return f"stopped {stopped_how()}; continue: {command}"
    return f"the limit came before the target; continue: {command} --{ending} N"


@contextmanager
def _interruption(trainer: Any) -> Iterator[None]:
    """Makes the first signal end the training before its next rollout, the second one at once."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        if trainer.is_interrupted:
            raise KeyboardInterrupt
        trainer.is_interrupted = True

    with StopSignals(stop, (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)):
        yield
