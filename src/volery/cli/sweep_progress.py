"""Shows the progress of a study: bars on a terminal, a few plain lines elsewhere."""

from __future__ import annotations

import math
import sys
import time
from typing import Any

from volery.cli.terminal import echo_line
from volery.cluster.driver import SweepProgress

_PLAIN_PERIOD_S = 10.0
_WORKERS_SHOWN = 16


class StudyProgress:
    """Shows finished and failed runs, the time left and what each worker does.

    err: on stderr, for a command whose stdout is for programs.
    """

    def __init__(self, name: str, *, err: bool = False) -> None:
        self._err = err
        self.flown = 0
        """Runs flown so far by this command."""
        self._name = name
        self._live: Any = None
        self._shown_at = time.monotonic()

    def __enter__(self) -> StudyProgress:
        """Starts the display."""
        if (sys.stderr if self._err else sys.stdout).isatty():
            from rich.console import Console
            from rich.live import Live

            console = Console(stderr=self._err)
            self._live = Live(console=console, transient=True, refresh_per_second=5)
            self._live.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        """Removes the display."""
        self.stop()

    def update(self, progress: SweepProgress) -> None:
        """Shows the present state."""
        self.flown = progress.flown
        if self._live is not None:
            self._live.update(_panel(self._name, progress))
        elif time.monotonic() - self._shown_at > _PLAIN_PERIOD_S:
            self._shown_at = time.monotonic()
            echo_line(f"{self._name}: {_summary(progress)}", err=self._err)

    def stop(self) -> None:
        """Removes the display; later output is printed below it."""
        if self._live is not None:
            self._live.stop()
            self._live = None


def _summary(progress: SweepProgress) -> str:
    rate = progress.flown / progress.elapsed_s if progress.elapsed_s > 0.0 else 0.0
    return (
        f"{progress.done:,} of {progress.total:,} runs, {progress.failed:,} failed, "
        f"{rate:.1f} runs/s, {_left(progress.left_s)}"
    )


def _left(seconds: float) -> str:
    if not math.isfinite(seconds):
        return "starting"
    minutes, rest = divmod(math.ceil(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02} left" if hours else f"{minutes}:{rest:02} left"


def _panel(name: str, progress: SweepProgress) -> Any:
    from rich.console import Group
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    head = Table.grid(expand=True, padding=(0, 1))
    head.add_column(no_wrap=True)
    head.add_column(ratio=1)
    head.add_column(justify="right", no_wrap=True)
    bar = ProgressBar(total=max(progress.total, 1), completed=progress.done)
    head.add_row(Text(name, style="bold"), bar, _summary(progress))
    workers = Table.grid(padding=(0, 2))
    for worker in progress.workers[:_WORKERS_SHOWN]:
        present = f"flies {worker.batch:,}" if worker.state == "busy" else worker.state
        workers.add_row(f"  {worker.name}", present, f"{worker.runs:,} done")
    note = f"  runs are flown one by one: {progress.obstacle}" if progress.obstacle else ""
    return Group(head, workers, Text(note, style="dim")) if note else Group(head, workers)
