"""What has come to a station: which messages are new, and what is to be acknowledged."""

from __future__ import annotations

from volery.comms.control_payloads import Received
from volery.comms.protocol import StationFrame

_SESSIONS_KEPT = 8
"""Of each source: a source that started anew may still have messages of before on their way."""


class ReceiveLog:
    """Remembers how far each source has come in each of its latest sessions."""

    def __init__(self) -> None:
        self._last: dict[int, dict[int, int]] = {}
        self._told: dict[tuple[int, int], int] = {}
        self._unacknowledged = 0
        self.duplicates = 0
        """Messages that had come before."""

    def __len__(self) -> int:
        """Messages since the last `take`."""
        return self._unacknowledged

    def is_new(self, frame: StationFrame) -> bool:
        """Whether a message comes for the first time; it will be acknowledged in either case."""
        sessions = self._last.setdefault(frame.source, {})
        last = sessions.get(frame.session, 0)
        newest = max(last, frame.sequence)
        sessions[frame.session] = newest
        if len(sessions) > _SESSIONS_KEPT:
            del sessions[next(iter(sessions))]
        self._told[frame.source, frame.session] = frame.sequence
        self._unacknowledged += 1
        new = frame.sequence > last
        self.duplicates += not new
        return new

    def take(self) -> list[Received]:
        """What to acknowledge, and nothing of it again."""
        told = [Received(source, session, last) for (source, session), last in self._told.items()]
        self._told.clear()
        self._unacknowledged = 0
        return told
