"""Says once that autopilots are waited for which nobody has started, where, and how to start them.

Without it a user sees UAVs stand on the ground for no reason.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

NOTICE_S = 5.0
"""Of wall time after a bridge has opened; PX4 connects within one second of its start."""
_MOST_NAMED = 3
_log = logging.getLogger(__name__)


class ConnectionNotice:
    """Looks once, in the loop that runs, after `after_s` (None: never) unless `cancel` comes first.

    what: the kind of autopilot. missing: where it is awaited, by UAV that has none. hint: how to
    start it.
    """

    def __init__(
        self,
        what: str,
        missing: Callable[[], Mapping[str, str]],
        hint: Callable[[], str],
        after_s: float | None = NOTICE_S,
    ) -> None:
        self._what, self._missing, self._hint = what, missing, hint
        self._timer: asyncio.TimerHandle | None = None
        if after_s is not None:
            self._timer = asyncio.get_running_loop().call_later(after_s, self._look)

    def cancel(self) -> None:
        """Say nothing; a second time nothing happens."""
        if self._timer is not None:
            self._timer.cancel()

    def _look(self) -> None:
        missing = self._missing()
        if missing:
            _log.warning("%s", notice(self._what, missing, self._hint()))


def notice(what: str, missing: Mapping[str, str], hint: str) -> str:
    """One line: for whom and where an autopilot is awaited, and how to start one."""
    places = [f"{uav} ({place})" for uav, place in missing.items()]
    more = len(places) - _MOST_NAMED
    named = ", ".join(places[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
    stand = "it stands" if len(places) == 1 else "they stand"
    return f"no {what} yet for {named}: {stand} still until one comes; {hint}"
