"""The messages that a station stores until the server settles them."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import NamedTuple

from volery.comms.addresses import is_station
from volery.comms.protocol import StationFrameKind
from volery.core.errors import CommsError
from volery.core.plurals import counted

MAX_PER_DESTINATION = 1024
"""As deep as a lane of the server, so that the server accepts all of them after a restart."""
MAX_MESSAGES = 4000
"""Max number that one WELCOME can list, and one burst may hold."""


class _Message(NamedTuple):
    kind: StationFrameKind
    destination: int
    data: bytes


class SendBuffer:
    """Stores messages by sequence, oldest first."""

    def __init__(self) -> None:
        self._messages: dict[int, _Message] = {}
        self._of: dict[int, dict[int, StationFrameKind]] = {}
        """Kinds by sequence, by destination."""
        self.dropped = 0
        """Measurements dropped for newer ones."""

    def __len__(self) -> int:
        return len(self._messages)

    def __contains__(self, sequence: int) -> bool:
        """Returns whether a message is stored."""
        return sequence in self._messages

    def put(self, sequence: int, kind: StationFrameKind, destination: int, data: bytes) -> None:
        """Stores a message. Raises CommsError if there is no room and no measurement to drop."""
        there = self._of.setdefault(destination, {})
        if len(there) >= MAX_PER_DESTINATION or len(self._messages) >= MAX_MESSAGES:
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
        """Removes settled messages."""
        for sequence in sequences:
            self._remove(sequence)

    def refuse(self, sequence: int) -> None:
        """Removes a refused message; one to many stays until the other receivers have it."""
        message = self._messages.get(sequence)
        if message is not None and is_station(message.destination):
            self._remove(sequence)

    def reconcile(self, last: int, unsettled: Collection[int]) -> None:
        """Removes all messages up to `last`, except the `unsettled` ones."""
        open_still = frozenset(unsettled)
        self.settle([s for s in self._messages if s <= last and s not in open_still])

    def after(self, last: int) -> list[bytes]:
        """Returns the messages after `last`, oldest first."""
        return [message.data for s, message in self._messages.items() if s > last]

    def _remove(self, sequence: int) -> None:
        message = self._messages.pop(sequence, None)
        if message is None:
            return
        there = self._of[message.destination]
        del there[sequence]
        if not there:
            del self._of[message.destination]
