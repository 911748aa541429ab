"""Logs once which autopilots have not connected, at which addresses, and how to start them.

Without the notice, UAVs stay on the ground without an explanation.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

NOTICE_S = 5.0
"""Wall time after a bridge has opened, s; PX4 connects within one second of its start."""
_MAX_NAMED = 3
_log = logging.getLogger(__name__)


class ConnectionNotice:
    """Checks once in the running loop after `after_s` (None: never) unless `cancel` comes first.

    what: the kind of autopilot. missing: returns addresses, by UAV without autopilot. hint: returns
    how to start one.
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
        """Cancels the check; further calls do nothing."""
        if self._timer is not None:
            self._timer.cancel()

    def _look(self) -> None:
        missing = self._missing()
        if missing:
            _log.warning("%s", notice(self._what, missing, self._hint()))


def notice(what: str, missing: Mapping[str, str], hint: str) -> str:
    """Returns one line with the UAVs, the addresses and how to start an autopilot."""
    entries = [f"{uav} ({address})" for uav, address in missing.items()]
    more = len(entries) - _MAX_NAMED
    named = ", ".join(entries[:_MAX_NAMED]) + (f" and {more} more" if more > 0 else "")
    stand = "it stays on the ground" if len(entries) == 1 else "they stay on the ground"
    return f"no {what} yet for {named}: {stand} until one connects; {hint}"
