"""Shows the progress of a flight: a bar on a terminal, a few plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from typing import Any

from volery.cli.terminal import echo_line
from volery.core.plain_text import plain

_PLAIN_PERIOD_S = 10.0


class FlightProgress:
    """Shows simulated time and real-time factor during a flight."""

    def __init__(self, name: str, duration_s: float) -> None:
        self._name = plain(name)
        self._duration_s = duration_s
        self._bar: Any = None
        self._task: Any = None
        self._shown_at = time.monotonic()
        self._paused = False

    def __enter__(self) -> FlightProgress:
        """Starts the display with the building of the world."""
        if sys.stdout.isatty():
            from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

            self._bar = Progress(
                SpinnerColumn(),
                TextColumn("[bold]{task.description}"),
                BarColumn(bar_width=None),
                TextColumn("{task.fields[state]}"),
                expand=True,
                transient=True,
            )
            self._bar.start()
            self._task = self._bar.add_task(
                self._name,
                total=self._duration_s,
                state="building the world; a first run compiles its kernels",
            )
        elif not _has_kernels():
            echo_line(f"{self._name}: compiling; later runs start at once")
        return self

    def __exit__(self, *_exception: object) -> None:
        """Removes the bar."""
        self._stop()

    def update(self, time_s: float, real_time_factor: float, *, paused: bool = False) -> None:
        """Shows the simulated time."""
        state = f"{time_s:.1f} of {self._duration_s:g} s  {real_time_factor:.1f} x real time"
        if paused:
            state = f"paused at {time_s:.3f} of {self._duration_s:g} s: space resumes, . steps"
        changed, self._paused = paused != self._paused, paused
        if self._bar is not None:
            self._bar.update(self._task, completed=time_s, state=state)
        elif changed or time.monotonic() - self._shown_at > _PLAIN_PERIOD_S:
            self._shown_at = time.monotonic()
            echo_line(f"{self._name}: {state}")

    def note(self, text: str) -> None:
        """Shows what is done after the flight; an empty text removes the note."""
        if sys.stdout.isatty():
            sys.stdout.write(f"\r\x1b[2K{plain(text)}")
            sys.stdout.flush()

    def finish(self, time_s: float) -> None:
        """Ends the display; later output is printed below the bar."""
        if self._bar is not None:
            self._bar.update(self._task, completed=time_s)
        self._stop()

    def _stop(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def _has_kernels() -> bool:
    """Returns whether an earlier run compiled kernels."""
    from volery.core.compiled import cache_dir

    return any(cache_dir().rglob("*.nbc"))
