"""What a station holds until the server is done with it."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import NamedTuple

from volery.comms.addresses import is_station
from volery.comms.protocol import StationFrameKind
from volery.core.errors import CommsError
from volery.core.plurals import counted

MOST_A_DESTINATION = 1024
"""As deep as a lane of the server, so that it takes all of them after a restart."""
MOST = 4000
"""As many as one WELCOME can name, and as one burst may hold."""


class _Message(NamedTuple):
    kind: StationFrameKind
    destination: int
    data: bytes


class SendBuffer:
    """Messages by sequence, oldest first."""

    def __init__(self) -> None:
        self._messages: dict[int, _Message] = {}
        self._of: dict[int, dict[int, StationFrameKind]] = {}
        """By destination: kinds by sequence."""
        self.dropped = 0
        """Measurements that had to go for newer ones."""

    def __len__(self) -> int:
        return len(self._messages)

    def __contains__(self, sequence: int) -> bool:
        """Whether a message is held."""
        return sequence in self._messages

    def put(self, sequence: int, kind: StationFrameKind, destination: int, data: bytes) -> None:
        """Hold a message. `CommsError` where there is no room, nor a measurement to give way."""
        there = self._of.setdefault(destination, {})
        if len(there) >= MOST_A_DESTINATION or len(self._messages) >= MOST:
            oldest = next(
                (s for s, held in there.items() if held is StationFrameKind.SENSING), None
            )
            if kind is StationFrameKind.COMMAND or oldest is None:
                raise CommsError(
                    f"{counted(len(there), 'message')} to {destination} and "
                    f"{len(self._messages)} in all are not settled yet: no room for another one"
                )
            self.dropped += 1
            self._remove(oldest)
            there = self._of.setdefault(destination, {})
        there[sequence] = kind
        self._messages[sequence] = _Message(kind, destination, data)

    def settle(self, sequences: Iterable[int]) -> None:
        """Forget these."""
        for sequence in sequences:
            self._remove(sequence)

    def refuse(self, sequence: int) -> None:
        """Forget what is refused; what is for many waits for the others."""
        message = self._messages.get(sequence)
        if message is not None and is_station(message.destination):
            self._remove(sequence)

    def reconcile(self, last: int, unsettled: Collection[int]) -> None:
        """Forget what a server has that knows all up to `last`, but for what it says."""
        open_still = frozenset(unsettled)
        self.settle([s for s in self._messages if s <= last and s not in open_still])

    def after(self, last: int) -> list[bytes]:
        """What a server has not got that has all up to `last`, oldest first."""
        return [message.data for s, message in self._messages.items() if s > last]

    def _remove(self, sequence: int) -> None:
        message = self._messages.pop(sequence, None)
        if message is None:
            return
        there = self._of[message.destination]
        del there[sequence]
        if not there:
            del self._of[message.destination]
