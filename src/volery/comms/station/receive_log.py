"""The log of received messages: detects repeated ones, and collects acknowledgements."""

from __future__ import annotations

from volery.comms.control_payloads import Received
from volery.comms.protocol import StationFrame

_SESSIONS_KEPT = 8
"""Number of sessions for each source: after a restart its older messages may still arrive."""


class ReceiveLog:
    """Stores the last sequence of each source in each of its latest sessions."""

    def __init__(self) -> None:
        self._last: dict[int, dict[int, int]] = {}
        self._logged: dict[tuple[int, int], int] = {}
        self._unacknowledged = 0
        self.duplicates = 0
        """Number of repeated messages."""

    def __len__(self) -> int:
        """Returns the number of messages since the last `take`."""
        return self._unacknowledged

    def is_new(self, frame: StationFrame) -> bool:
        """Returns whether a message is new; it is acknowledged in either case."""
        sessions = self._last.setdefault(frame.source, {})
        last = sessions.get(frame.session, 0)
        newest = max(last, frame.sequence)
        sessions[frame.session] = newest
        if len(sessions) > _SESSIONS_KEPT:
            del sessions[next(iter(sessions))]
        self._logged[frame.source, frame.session] = frame.sequence
        self._unacknowledged += 1
        new = frame.sequence > last
        self.duplicates += not new
        return new

    def take(self) -> list[Received]:
        """Returns the pending acknowledgements and clears them."""
        received = [
            Received(source, session, last) for (source, session), last in self._logged.items()
        ]
        self._logged.clear()
        self._unacknowledged = 0
        return received
