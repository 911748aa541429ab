"""Accepted connections whose first request has not come yet.

A server spends buffers, tasks and a session on each connection. One that stays silent, or sends
half a request, waits here instead, as a bare socket, until its first bytes are enough for the
server. They are looked at and left in the socket, so the server reads them as ever.
"""

from __future__ import annotations

import asyncio
import errno
import select
import socket
from collections.abc import Callable
from typing import Any, NamedTuple

from volery.core.preamble import Preamble

LOOK_BYTES = 4096
"""A first request without an end in so many bytes is left to the server."""
_END_OF_HEAD = (b"\r\n\r\n", b"\n\n")
_END = select.EPOLLRDHUP | select.EPOLLHUP if hasattr(select, "epoll") else 0


class Look(NamedTuple):
    """What the first bytes of a connection show."""

    is_ready: bool
    """Whether the server can make something of them."""
    stranger: str | None = None
    """The forbidden protocol that they speak, see `Preamble`."""


_NOTHING = Look(is_ready=False)


def look_at_http(first: bytes) -> Look:
    """HTTP and WebSocket servers get connections with a whole head of a request."""
    return Look(any(end in first for end in _END_OF_HEAD))


def look_at_binary(first: bytes) -> Look:
    """Servers of binary protocols get all that are not web browsers, with their first bytes."""
    preamble = Preamble()
    is_decided = bool(preamble.feed(first))
    return Look(is_decided, preamble.refused)


class Event(NamedTuple):
    """Something has happened to a socket."""

    descriptor: int
    """The listening one's, or of one that waits."""
    is_end: bool
    """Whether the client sends no more."""


class WaitingConnection(NamedTuple):
    """A connection that waits."""

    sock: socket.socket
    address: Any
    since_s: float
    """Of the loop's clock."""


class WaitingRoom:
    """The connections of one listening socket that wait, and that socket itself.

    All methods belong to the thread of the server's asyncio loop. Where the system has no epoll
    (`is_available`), servers get connections at once.

    look: what the first bytes of a connection show. patience_s: after which a connection is given
    to `expire`; None: never.
    """

    is_available = hasattr(select, "epoll")

    def __init__(
        self,
        listening: int,
        look: Callable[[bytes], Look],
        patience_s: float | None,
        expire: Callable[[WaitingConnection], None],
    ) -> None:
        self._listening = listening
        self._look = look
        self._patience_s = patience_s
        self._expire = expire
        self._waiting: dict[int, WaitingConnection] = {}
        """By file descriptor, the oldest first."""
        self._timer: asyncio.TimerHandle | None = None
        self._epoll = select.epoll()
        self._epoll.register(listening, select.EPOLLIN)

    def fileno(self) -> int:
        """Returns the descriptor that is readable when `next_event` has something."""
        return -1 if self._epoll.closed else self._epoll.fileno()

    def __contains__(self, descriptor: int) -> bool:
        return descriptor in self._waiting

    def next_event(self) -> Event:
        """Returns what has happened next.

        Raises
        ------
        BlockingIOError
            Nothing has happened.

        """
        for descriptor, flags in self._epoll.poll(0, 1):  # one: the others keep `fileno` readable
            return Event(descriptor, bool(flags & _END))
        raise BlockingIOError(errno.EAGAIN, "no connection is ready")

    def admit(self, sock: socket.socket, address: Any) -> None:
        """Lets a connection wait."""
        loop = asyncio.get_running_loop()
        sock.setblocking(False)
        self._waiting[sock.fileno()] = WaitingConnection(sock, address, loop.time())
        flags = select.EPOLLIN | select.EPOLLRDHUP | select.EPOLLET  # once for each piece
        self._epoll.register(sock.fileno(), flags)
        if self._timer is None and self._patience_s is not None:
            self._timer = loop.call_later(self._patience_s, self._end_patience)

    def look(self, event: Event) -> Look | None:
        """Returns what has come of a connection that waits; None: too little, and no more comes."""
        look = self._look_at(self._waiting[event.descriptor].sock)
        return None if event.is_end and look == _NOTHING else look

    def release(self, descriptor: int) -> WaitingConnection:
        """Returns a connection that waits no longer."""
        waiting = self._waiting.pop(descriptor)
        self._epoll.unregister(descriptor)
        return waiting

    def close(self) -> None:
        """Ends the connections that wait."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        for descriptor in tuple(self._waiting):
            self.release(descriptor).sock.close()
        self._epoll.close()

    def _look_at(self, sock: socket.socket) -> Look:
        try:
            first = sock.recv(LOOK_BYTES, socket.MSG_PEEK)
        except OSError:  # nothing yet, or the connection is broken, which is an event of its own
            return _NOTHING
        look = self._look(first)
        return look._replace(is_ready=True) if len(first) >= LOOK_BYTES else look

    def _end_patience(self) -> None:
        assert self._patience_s is not None
        loop = asyncio.get_running_loop()
        latest_s = loop.time() - self._patience_s
        for waiting in tuple(self._waiting.values()):
            if waiting.since_s > latest_s:
                self._timer = loop.call_at(waiting.since_s + self._patience_s, self._end_patience)
                return
            self.release(waiting.sock.fileno())
            self._expire(waiting)
        self._timer = None
