"""Shows the progress of a training: a bar on a terminal, a few plain lines elsewhere."""

from __future__ import annotations

import time
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from volery.learning.training.evaluation import Evaluation
from volery.learning.training.trainer import Trainer

_PLAIN_PERIOD_S = 10.0
_RATE_PERIOD_S = 1.0


class TrainingProgress:
    """Shows steps, return, success and decisions per second."""

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._bar: Progress | None = None
        self._row: Any = None
        self._shown_at = self._rated_at = time.monotonic()
        self._rated_steps = 0
        self._rate = 0.0

    def on_update(self, trainer: Trainer) -> None:
        """Shows the latest episodes."""
        now = time.monotonic()
        if trainer.steps < self._rated_steps or self._rated_steps == 0:
            self._rated_at, self._rated_steps = now, max(trainer.steps, 1)
        elif now - self._rated_at > _RATE_PERIOD_S:
            self._rate = (trainer.steps - self._rated_steps) / (now - self._rated_at)
            self._rated_at, self._rated_steps = now, trainer.steps
        if self._console.is_terminal:
            self._show(trainer)
        elif now - self._shown_at > _PLAIN_PERIOD_S:
            self._shown_at = now
            self._console.print(f"{trainer.task.name}: {self._words(trainer)}", highlight=False)

    def on_evaluation(self, trainer: Trainer, evaluation: Evaluation) -> None:
        """Prints a line."""
        console = self._bar.console if self._bar else self._console
        console.print(
            f"{trainer.task.name}: {trainer.steps:,} steps, {trainer.seconds:.0f} s: evaluation: "
            f"success {evaluation.success:.1%}, return {evaluation.mean_return:.2f}",
            highlight=False,
        )

    def close(self) -> None:
        """Removes the bar."""
        if self._bar is not None:
            self._bar.stop()

    def _show(self, trainer: Trainer) -> None:
        if self._bar is None:
            self._bar = Progress(
                TextColumn("[bold]{task.description}"),
                BarColumn(bar_width=None),
                TextColumn("{task.fields[state]}"),
                TimeElapsedColumn(),
                console=self._console,
                expand=True,
                transient=True,
            )
            self._bar.start()
            self._row = self._bar.add_task(
                trainer.task.name, total=trainer.configuration.steps, state=""
            )
        self._bar.update(self._row, completed=trainer.steps, state=self._words(trainer))

    def _words(self, trainer: Trainer) -> str:
        latest = trainer.latest
        return (
            f"{trainer.steps:,} steps  return {latest.mean_return:.2f}  "
            f"success {latest.success:.1%}  {self._rate:,.0f} steps/s"
        )
