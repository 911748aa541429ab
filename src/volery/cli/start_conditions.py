"""Waits for external nodes and clients and pauses the clock before the first step."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from volery.cli.terminal import echo_line
from volery.core.errors import CommandError

if TYPE_CHECKING:
    from volery.runtime.facets.clock import RunClock
    from volery.runtime.simulation import Simulation

DEFAULT_TIMEOUT_S = 60.0
_PERIOD_S = 0.02


def wait_for_clients(
    simulation: Simulation,
    names: Sequence[str],
    timeout_s: float,
    is_stopped: Callable[[], bool],
) -> bool:
    """Waits until all `names` are connected; returns False if `is_stopped()` before that.

    A name is that of an external node, `/uav1/watcher` or `watcher`, of a lock-step partner, or of
    a client as the page lists it; one word of a name is enough: `rosbridge`. Raises `CommandError`
    with the missing names after `timeout_s` of wall time.
    """
    if not names:
        return True
    until = time.monotonic() + timeout_s
    missing = _missing(simulation, names)
    if missing:
        echo_line(f"waiting for {', '.join(missing)}, at most {timeout_s:g} s", err=True)
    while missing:
        if is_stopped():
            return False
        if time.monotonic() >= until:
            present = ", ".join(sorted(simulation.diagnostics.client_names)) or "none"
            raise CommandError(
                f"--wait-for: {', '.join(missing)} not connected within {timeout_s:g} s; "
                f"connected: {present}"
            )
        time.sleep(_PERIOD_S)
        simulation.process_commands()
        before, missing = missing, _missing(simulation, names)
        for name in before:
            if name not in missing:
                echo_line(f"{name} is connected", err=True)
    return True


def start_paused(clock: RunClock, *, can_be_resumed: bool) -> None:
    """Pauses the clock before the first step.

    Raises `CommandError` if no client could resume the run.
    """
    if not (can_be_resumed or sys.stdin.isatty()):
        raise CommandError(
            "--start-paused: nothing can resume this run; open the page (--page) or a bridge "
            "(--bridge rosbridge), or start it at a terminal"
        )
    clock.pause()
    echo_line(
        "paused before the first step: space at this terminal, Play on the page or "
        "/set_simulation_state resumes the run",
        err=True,
    )


def _missing(simulation: Simulation, names: Sequence[str]) -> list[str]:
    present = simulation.diagnostics.client_names
    words = {word for name in present for word in (name, *name.split(), name.rpartition("/")[2])}
    return [name for name in names if name not in words]
