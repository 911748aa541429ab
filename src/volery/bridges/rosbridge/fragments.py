"""Splits operations into fragments and assembles them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from volery.bridges.rosbridge.wire import Operation, encode_json
from volery.bridges.unfinished import MAX_UNFINISHED_S, NO_ROOM, SHARED, UnfinishedMessages
from volery.core.errors import BridgeError

MAX_OPEN = 32
"""Messages of one client that may be incomplete at once."""
MAX_FRAGMENTS = 100_000
"""Fragments of one message."""
_OVERHEAD_BYTES = 64
"""Cost of storing a fragment besides its text, so that empty ones count too."""


def split(text: str, size: int, name: str) -> Iterator[str]:
    """Yields fragments of JSON text with at most `size` characters each, in order.

    name: the id they share.
    """
    total = -(-len(text) // size)
    for number in range(total):
        data = text[number * size : (number + 1) * size]
        yield encode_json(
            {"op": "fragment", "id": name, "data": data, "num": number, "total": total}
        )


@dataclass
class _Open:
    total: int
    began_s: float
    parts: dict[int, str] = field(default_factory=dict)
    size: int = 0
    memory_bytes: int = 0


class Assembly:
    """Assembles fragments. Incomplete messages are dropped after a while, or for lack of room.

    on_dropped: called in any thread to have `drop_all` called in that of the client.
    """

    def __init__(
        self,
        max_bytes: int,
        on_dropped: Callable[[], None] = lambda: None,
        account: UnfinishedMessages = SHARED,
    ) -> None:
        self._max_bytes = max_bytes
        self._open: dict[str, _Open] = {}
        self._size = 0
        self._budget = account.open(on_dropped)

    @property
    def waiting(self) -> int:
        """Number of incomplete messages."""
        return len(self._open)

    def add(self, operation: Operation, now_s: float) -> str | None:
        """Adds a fragment; returns the whole text with the last one.

        Repeated fragments are ignored.

        Raises
        ------
        BridgeError
                It is malformed, contradicts the others, or there would be too much; its message is
                dropped.

        """
        self.drop_old(now_s)
        name, data = operation.get("id"), operation.get("data")
        number, total = operation.get("num"), operation.get("total")
        if not isinstance(name, (str, int)) or not isinstance(data, str):
            raise BridgeError("fragment: 'id' and 'data' must be text")
        key = repr(name)
        if isinstance(total, float) and total.is_integer():
            total = int(total)
        if type(number) is not int or type(total) is not int or not 0 <= number < total:
            self._forget(key)
            raise BridgeError("fragment: 'num' must be 0 to 'total' - 1")
        message = self._message(key, total, now_s)
        if number not in message.parts:
            cost = len(data) + _OVERHEAD_BYTES
            if self._size + cost > self._max_bytes:
                self._forget(key)
                raise BridgeError(f"fragment: more than {self._max_bytes} bytes are incomplete")
            memory_bytes = sys.getsizeof(data) + _OVERHEAD_BYTES
            if not self._budget.hold(self._memory_bytes + memory_bytes):
                self._forget(key)
                raise BridgeError(f"fragment: {NO_ROOM}")
            message.memory_bytes += memory_bytes
            message.parts[number] = data
            message.size += cost
            self._size += cost
        if len(message.parts) < total:
            return None
        self._forget(key)
        return "".join(message.parts[k] for k in range(total))

    def drop_old(self, now_s: float) -> None:
        """Drops messages that have been incomplete for too long."""
        late_s = now_s - MAX_UNFINISHED_S
        for key in [k for k, m in self._open.items() if m.began_s < late_s]:
            self._forget(key)

    def due_s(self) -> float | None:
        """Returns when to call `drop_old`; None: there is nothing to drop."""
        began_s = (message.began_s for message in self._open.values())
        return min((s + MAX_UNFINISHED_S for s in began_s), default=None)

    def drop_all(self) -> bool:
        """Drops all incomplete messages; returns whether there were any."""
        had_some = bool(self._open)
        for key in tuple(self._open):
            self._forget(key)
        return had_some

    def close(self) -> None:
        """Frees everything of a client that has left."""
        self._open.clear()
        self._size = 0
        self._budget.close()

    @property
    def _memory_bytes(self) -> int:
        return sum(message.memory_bytes for message in self._open.values())

    def _message(self, key: str, total: int, now_s: float) -> _Open:
        message = self._open.get(key)
        if message is None:
            if total > MAX_FRAGMENTS:
                raise BridgeError(f"fragment: more than {MAX_FRAGMENTS} of one message")
            if len(self._open) >= MAX_OPEN:
                raise BridgeError(f"fragment: more than {MAX_OPEN} messages are incomplete")
            message = self._open[key] = _Open(total, now_s)
        if message.total != total:
            self._forget(key)
            raise BridgeError("fragment: 'total' differs from that of the other fragments")
        return message

    def _forget(self, key: str) -> None:
        message = self._open.pop(key, None)
        if message is not None:
            self._size -= message.size
            self._budget.hold(self._memory_bytes)
