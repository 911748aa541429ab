"""What happens where a scenario ends while clients are connected: the simulation waits for them.

It stays paused at its end until a client resets it, restores a snapshot, continues past the end or
loads another scenario. Meanwhile commands that would have no effect are refused with a reason.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from volery.core.clock import s_from_ns
from volery.core.errors import CommandError
from volery.graph.session import ClientCommand
from volery.runtime.replay.command_effects import restarts

if TYPE_CHECKING:
    from volery.engine.engine import Engine
    from volery.engine.pacing import Pacer
    from volery.runtime.replay.command_log import CommandLog
    from volery.runtime.run_loop import RunLoop

_PERIOD_S = 0.02
"""Wall time between two looks at what clients want."""


class EndOfRun:
    """Holds a simulation at its end; `waits` is True meanwhile."""

    def __init__(self, engine: Engine, pacer: Pacer, loop: RunLoop, commands: CommandLog) -> None:
        self._engine = engine
        self._pacer = pacer
        self._loop = loop
        self.waits = False
        commands.refuse = self._refusal

    @property
    def notice(self) -> str:
        """What clients read whose commands are refused."""
        return (
            f"the scenario ended at {s_from_ns(self._engine.time_ns):.1f} s: reset it, "
            "or call /volery/continue_run to fly on"
        )

    def wait(self, process: Callable[[], None]) -> None:
        """Stay at the end until it is no longer one; `process` handles what clients send."""
        self._pacer.pause()
        self.waits = True
        try:
            while self._loop.finished and not self._loop.quitting:
                process()
                time.sleep(_PERIOD_S)
        finally:
            self.waits = False

    def fly_on(self) -> None:
        """Continue past the end. `CommandError` where the scenario has not ended."""
        if not self.waits:
            raise CommandError("the scenario has not ended")
        self._loop.past_end = True
        self.waits = False
        self._pacer.resume()

    def left(self) -> None:
        """Another state was restored: commands have effect again."""
        self.waits = self.waits and self._loop.finished

    def _refusal(self, command: ClientCommand) -> str:
        """Return why a client's command is refused; empty: it is not."""
        return self.notice if self.waits and not restarts(command) else ""
