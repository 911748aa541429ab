"""Limits the memory and the time of clients' messages that are incomplete or not yet processed.

One account counts the bytes of all clients of all servers of this process: parts of WebSocket
messages and ROS-TCP frames, and fragments of rosbridge. A lone client may use as much as its
protocol allows. When the account is full, each client with such bytes has an equal part of it: one
that has more is not read from until there is room, and one that has less gets room by the end of
the oldest message of a client that has more. Where many clients send large messages, they are read
in turns, so that others hardly wait.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from weakref import WeakKeyDictionary

from volery.core.allocator import return_free_memory

MAX_UNFINISHED_BYTES = 96 << 20
"""Bytes of all clients together (modelling choice): more than the largest ROS-TCP frame, 64 MiB."""
MAX_UNFINISHED_S = 30.0
"""Time from the first to the last byte of a message, or to its last fragment."""
NO_ROOM = "the server has no room for unfinished messages; send it again later"
TOO_SLOW = f"a message was not complete after {MAX_UNFINISHED_S:g} s"

_IGNORED_BYTES = 4096
"""Fewer bytes of a client count as none, so that short commands cost nothing."""
_READ_BYTES = 64 << 10
"""Room for which one waiting client is read again, and what a client may have beyond its part."""
_FEW = 16
"""Clients that are read without turns."""
_READS_A_ROUND = 4
"""Clients that are read in one round of a loop where there are more."""
_RETURNED_BYTES = 16 << 20
_RETURN_PERIOD_S = 0.5
"""Freed bytes and time after which free memory is returned to the system: blocks of many clients
leave holes between each other."""
_LEFT_BYTES = 1 << 20
"""Freed bytes that are returned after clients have left."""


class UnfinishedMessages:
    """Account of all clients; thread-safe."""

    def __init__(self, max_bytes: int = MAX_UNFINISHED_BYTES) -> None:
        self._max_bytes = max_bytes
        self._lock = threading.Lock()
        self._held_bytes: dict[UnfinishedBytes, int] = {}
        """Bytes of each client that has some, in the order in which they began."""
        self._total = 0
        self._waiting: dict[UnfinishedBytes, None] = {}
        self._freed = 0
        """Bytes freed since memory was returned to the system."""
        self._returned_s = 0.0

    @property
    def num_bytes(self) -> int:
        """Bytes of all clients."""
        return self._total

    @property
    def is_crowded(self) -> bool:
        """Whether so many clients have bytes here that they are read in turns."""
        return len(self._held_bytes) > _FEW

    def open(
        self, evict: Callable[[], None], resume: Callable[[], None] = lambda: None
    ) -> UnfinishedBytes:
        """Returns the share of a client.

        evict: drops what the client has sent of its messages. resume: reads from the client again.
        Both may be called in any thread, and must not block.
        """
        return UnfinishedBytes(self, evict, resume)

    def hold(self, budget: UnfinishedBytes, size: int, *, may_wait: bool) -> bool:
        """Counts the bytes of a client; used by `UnfinishedBytes`."""
        evicted: list[UnfinishedBytes] = []
        with self._lock:
            before = self._set(budget, size)
            has_room = self._total <= self._max_bytes or size <= before
            if not has_room:
                part = self._part()
                if size <= part:
                    evicted = self._evict_beyond(part)
                    has_room = True
                elif may_wait:
                    self._waiting[budget] = None
                else:
                    self._set(budget, before)
            resumed = self._next_waiting()
            if budget in self._waiting and size < min(before, self._part()):
                del self._waiting[budget]
                resumed.append(budget)
            returns = self._returns_memory()
        for other in evicted:
            other.evict()
        for other in resumed:
            other.resume()
        if returns:
            return_free_memory()
        return has_room

    def _part(self) -> int:
        """Returns the equal part of each client that has bytes here."""
        return self._max_bytes // max(1, len(self._held_bytes))

    def _set(self, budget: UnfinishedBytes, size: int) -> int:
        """Sets the bytes of a client, and returns those of before."""
        before = self._held_bytes.get(budget, 0)
        if size:
            self._held_bytes[budget] = size
        else:
            self._held_bytes.pop(budget, None)
        self._total += size - before
        self._freed += max(0, before - size)
        return before

    def _returns_memory(self) -> bool:
        """Returns whether enough was freed to return memory to the system now."""
        now_s = time.monotonic()
        if self._freed < _RETURNED_BYTES or now_s < self._returned_s + _RETURN_PERIOD_S:
            return False
        self._freed, self._returned_s = 0, now_s
        return True

    def owes_memory(self) -> bool:
        """Returns whether much was freed since memory was last returned to the system."""
        return self._freed >= _LEFT_BYTES

    def return_memory(self) -> None:
        """Returns free memory to the system."""
        with self._lock:
            self._freed, self._returned_s = 0, time.monotonic()
        return_free_memory()

    def _evict_beyond(self, part: int) -> list[UnfinishedBytes]:
        """Makes room: removes clients with more than an equal part, oldest messages first."""
        found = []
        for budget, size in tuple(self._held_bytes.items()):
            if self._total <= self._max_bytes:
                break
            if size > part + _READ_BYTES:
                self._set(budget, 0)
                self._waiting.pop(budget, None)
                found.append(budget)
        return found

    def _next_waiting(self) -> list[UnfinishedBytes]:
        """Returns clients for which there is room again, in the order of waiting."""
        room = (self._max_bytes - self._total) // _READ_BYTES
        found = list(self._waiting)[:room] if room > 0 and self._waiting else []
        for budget in found:
            del self._waiting[budget]
        return found


def _nothing() -> None:
    """Does nothing."""


def _ignore(_reason: str) -> None:
    """Does nothing."""


SHARED = UnfinishedMessages()
"""The account of all servers of the process."""


class UnfinishedBytes:
    """Share of one client, or of one kind of its messages, in the account."""

    def __init__(
        self, account: UnfinishedMessages, evict: Callable[[], None], resume: Callable[[], None]
    ) -> None:
        self._account = account
        self._size = 0
        self.evict = evict
        self.resume = resume

    def hold(self, size: int, *, may_wait: bool = False) -> bool:
        """Sets the bytes of the client; returns False if there is no room for them.

        may_wait: the bytes count nevertheless, and `resume` is called when there is room for more.
        """
        size = 0 if size < _IGNORED_BYTES else size
        if size == self._size:
            return True
        has_room = self._account.hold(self, size, may_wait=may_wait)
        if has_room or may_wait:
            self._size = size
        return has_room

    def close(self) -> None:
        """Frees the bytes of a client that has left; later calls of `hold` must not follow."""
        self._account.hold(self, 0, may_wait=False)
        self._size = 0
        self.evict = self.resume = _nothing  # they refer to the client


class _ReadTurns:
    """Queue of one loop's connections for a further read, a few in each round of the loop."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()
        self._is_granting = False
        self._is_returning = False

    def return_memory_soon(
        self, loop: asyncio.AbstractEventLoop, account: UnfinishedMessages
    ) -> None:
        """Returns free memory when those that leave at the same time have left."""
        if not self._is_returning:
            self._is_returning = True
            loop.call_later(_RETURN_PERIOD_S, self._return, account)

    def _return(self, account: UnfinishedMessages) -> None:
        self._is_returning = False
        account.return_memory()

    def wait(self, loop: asyncio.AbstractEventLoop, resume: Callable[[], None]) -> None:
        """Calls `resume` when it is the connection's turn."""
        self._waiting.append(resume)
        if not self._is_granting:
            self._is_granting = True
            loop.call_soon(self._grant, loop)

    def _grant(self, loop: asyncio.AbstractEventLoop) -> None:
        for _ in range(min(_READS_A_ROUND, len(self._waiting))):
            self._waiting.popleft()()
        self._is_granting = bool(self._waiting)
        if self._is_granting:
            loop.call_soon(self._grant, loop)


_turns: WeakKeyDictionary[asyncio.AbstractEventLoop, _ReadTurns] = WeakKeyDictionary()


class ArrivingMessages:
    """Counts what a connection has received of its messages. Belongs to its loop's thread.

    end: ends the connection for a reason. pause, resume: stop reading from it, and read again.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        end: Callable[[str], None],
        pause: Callable[[], None],
        resume: Callable[[], None],
        account: UnfinishedMessages = SHARED,
    ) -> None:
        self._loop = loop
        self._end = end
        self._pause = pause
        self._resume = resume
        self._account = account
        self._turns = _turns.setdefault(loop, _ReadTurns())
        self._has_room = self._has_turn = True
        self._budget = account.open(
            lambda: self._post(lambda: self._end_once(NO_ROOM)), lambda: self._post(self._room)
        )
        self._began_s: float | None = None
        """Time at which the incomplete message began; None: there is none."""
        self._timer: asyncio.TimerHandle | None = None
        self._has_ended = False

    def note(self, incomplete: int, waiting: int = 0) -> None:
        """Sets the bytes of an incomplete message, and of whole ones that are not processed.

        What a client sends after its end is read in turns too.
        """
        if not self._has_ended:
            self._count(incomplete, waiting)
        is_large = self._has_ended or incomplete >= _IGNORED_BYTES
        if is_large:
            self._take_turns()
        if not (self._has_room and self._has_turn):
            self._pause()

    def _count(self, incomplete: int, waiting: int) -> None:
        if not incomplete:
            self._began_s = None
        elif self._began_s is None:
            self.restart()
        if not self._budget.hold(incomplete + waiting, may_wait=True):
            self._has_room = False

    def _take_turns(self) -> None:
        """Waits for a turn among many clients."""
        if self._has_turn and self._account.is_crowded:
            self._has_turn = False
            self._turns.wait(self._loop, self._turn)

    def _room(self) -> None:
        self._has_room = True
        self._take_turns()  # others have got room at the same time
        self._read_on()

    def _turn(self) -> None:
        self._has_turn = True
        self._read_on()

    def _read_on(self) -> None:
        if self._has_room and self._has_turn:
            self._resume()

    def restart(self) -> None:
        """Counts the time of an incomplete message from now on."""
        self._began_s = self._loop.time()
        if self._timer is None:
            self._timer = self._loop.call_later(MAX_UNFINISHED_S, self._check)

    def finish(self) -> None:
        """Notes that a message is complete; what follows is another one."""
        if self._began_s is not None:
            self._began_s = self._loop.time()

    def close(self) -> None:
        """Frees everything after the connection is lost."""
        self._free()
        self._end = _ignore
        self._pause = self._resume = _nothing

    def _free(self) -> None:
        self._has_ended = True
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._budget.close()
        if self._account.owes_memory():
            self._turns.return_memory_soon(self._loop, self._account)

    def _check(self) -> None:
        self._timer = None
        if self._began_s is None or self._has_ended:
            return
        left_s = self._began_s + MAX_UNFINISHED_S - self._loop.time()
        if left_s <= 0.0:
            self._end_once(TOO_SLOW)
        else:
            self._timer = self._loop.call_later(left_s, self._check)

    def _end_once(self, reason: str) -> None:
        if not self._has_ended:
            end, self._end = self._end, _ignore
            self._free()
            end(reason)

    def _post(self, action: Callable[[], None]) -> None:
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(action)
