"""Pauses a simulation at the end of its scenario while clients are connected.

It stays paused until a client resets it, restores a snapshot, continues past the end or loads
another scenario. Meanwhile it refuses commands that would have no effect, with a reason.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from volery.core.clock import s_from_ns
from volery.core.errors import CommandError
from volery.engine.engine import Engine
from volery.engine.pacing import Pacer
from volery.graph.session import ClientCommand
from volery.runtime.replay.command_effects import restarts
from volery.runtime.run_loop import RunLoop

_PERIOD_S = 0.02
"""Wall time between two checks of client requests, s."""


class EndOfRun:
    """Holds a simulation at its end; `waits` is True meanwhile."""

    def __init__(self, engine: Engine, pacer: Pacer, loop: RunLoop) -> None:
        self._engine = engine
        self._pacer = pacer
        self._loop = loop
        self.waits = False

    @property
    def notice(self) -> str:
        """Reason that clients receive for refused commands."""
        return (
            f"the scenario ended at {s_from_ns(self._engine.time_ns):.1f} s: reset it, "
            "or call /volery/continue_run to fly on"
        )

    def wait(self, process: Callable[[], None]) -> None:
        """Waits while the run is at its end; `process` handles client requests meanwhile."""
        self._pacer.pause()
        self.waits = True
        try:
            while self._loop.finished and not self._loop.quitting:
                process()
                time.sleep(_PERIOD_S)
        finally:
            self.waits = False

    def fly_on(self) -> None:
        """Continues past the end. Raises `CommandError` if the scenario has not ended."""
        if not self.waits:
            raise CommandError("the scenario has not ended")
        self._loop.past_end = True
        self.waits = False
        self._pacer.resume()

    def left(self) -> None:
        """Accepts commands again after another state was restored."""
        self.waits = self.waits and self._loop.finished

    def refusal(self, command: ClientCommand) -> str:
        """Returns why a client's command is refused; empty: accepted."""
        return self.notice if self.waits and not restarts(command) else ""
