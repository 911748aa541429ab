"""Shows the progress of a run as a bar of tqdm, on terminals and in notebooks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from volery.core.extras import import_extra
from volery.runtime.monitoring.progress import Progress

OnProgress = Callable[[Progress], None]
_FORM = "{l_bar}{bar}| {n:.1f}/{total:.1f} s [{elapsed}<{remaining}{postfix}]"
_ENDLESS_FORM = "{desc}: {n:.1f} s [{elapsed}{postfix}]"


@contextmanager
def progress_bar(name: str, on_progress: OnProgress | None = None) -> Iterator[OnProgress]:
    """Opens a bar of simulated seconds; yields the function that updates it.

    on_progress: called with each update, too. Raises `VoleryError` without tqdm.
    """
    tqdm = import_extra("progress=True", "tqdm.auto", "tqdm", "progress").tqdm
    bar: Any = None

    def update(progress: Progress) -> None:
        nonlocal bar
        if bar is None:
            has_end = math.isfinite(progress.duration_s)
            total = progress.duration_s if has_end else None
            bar = tqdm(desc=name, total=total, bar_format=_FORM if has_end else _ENDLESS_FORM)
        bar.n = progress.time_s
        state = ", paused" if progress.paused else ""
        bar.set_postfix_str(f"{progress.real_time_factor:.1f} x real time{state}")
        if on_progress is not None:
            on_progress(progress)

    try:
        yield update
    finally:
        if bar is not None:
            bar.close()
