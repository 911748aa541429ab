"""Holds accepted connections until their first request has arrived.

A server spends buffers, tasks and a session on each connection. A connection that stays silent, or
sends half a request, waits here as a bare socket until its first bytes suffice for the server. The
bytes are only peeked at, so the server reads them as usual.
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
"""A longer first request is passed to the server incomplete."""
_END_OF_HEAD = (b"\r\n\r\n", b"\n\n")
_END = select.EPOLLRDHUP | select.EPOLLHUP if hasattr(select, "epoll") else 0


class Look(NamedTuple):
    """Result of examining the first bytes of a connection."""

    is_ready: bool
    """Whether the server can process them."""
    foreign_protocol: str | None = None
    """Their forbidden protocol, see `Preamble`."""


_NOTHING = Look(is_ready=False)


def look_at_http(first: bytes) -> Look:
    """Accepts a complete request head, for HTTP and WebSocket servers."""
    return Look(any(end in first for end in _END_OF_HEAD))


def look_at_binary(first: bytes) -> Look:
    """Accepts the first bytes of any client but a web browser, for binary protocols."""
    preamble = Preamble()
    is_decided = bool(preamble.feed(first))
    return Look(is_decided, preamble.refused)


class Event(NamedTuple):
    """An event on a socket."""

    descriptor: int
    """Descriptor of the listening socket or a waiting connection."""
    is_end: bool
    """Whether the client has stopped sending."""


class PendingConnection(NamedTuple):
    """A waiting connection."""

    sock: socket.socket
    address: Any
    since_s: float
    """Start of the wait on the loop's clock, s."""


class PendingConnections:
    """The waiting connections of one listening socket, and that socket.

    All methods are called in the thread of the server's asyncio loop. On a system without epoll
    (`is_available`), servers get connections at once.

    look: examines the first bytes of a connection. timeout_s: maximum waiting time, after which a
    connection is passed to `expire`; None: unlimited.
    """

    is_available = hasattr(select, "epoll")

    def __init__(
        self,
        listening: int,
        look: Callable[[bytes], Look],
        timeout_s: float | None,
        expire: Callable[[PendingConnection], None],
    ) -> None:
        self._listening = listening
        self._look = look
        self._timeout_s = timeout_s
        self._expire = expire
        self._waiting: dict[int, PendingConnection] = {}
        """By file descriptor, oldest first."""
        self._timer: asyncio.TimerHandle | None = None
        self._epoll = select.epoll()
        self._epoll.register(listening, select.EPOLLIN)

    def fileno(self) -> int:
        """Returns the descriptor that is readable when `next_event` has an event."""
        return -1 if self._epoll.closed else self._epoll.fileno()

    def __contains__(self, descriptor: int) -> bool:
        return descriptor in self._waiting

    def next_event(self) -> Event:
        """Returns the next event. Raises `BlockingIOError` if there is none."""
        for descriptor, flags in self._epoll.poll(0, 1):  # one; others keep `fileno` readable
            return Event(descriptor, bool(flags & _END))
        raise BlockingIOError(errno.EAGAIN, "no connection is ready")

    def admit(self, sock: socket.socket, address: Any) -> None:
        """Adds a connection."""
        loop = asyncio.get_running_loop()
        sock.setblocking(False)
        self._waiting[sock.fileno()] = PendingConnection(sock, address, loop.time())
        flags = select.EPOLLIN | select.EPOLLRDHUP | select.EPOLLET  # once per piece
        self._epoll.register(sock.fileno(), flags)
        if self._timer is None and self._timeout_s is not None:
            self._timer = loop.call_later(self._timeout_s, self._on_timeout)

    def look(self, event: Event) -> Look | None:
        """Examines a waiting connection; None if incomplete although the client has finished."""
        look = self._look_at(self._waiting[event.descriptor].sock)
        return None if event.is_end and look == _NOTHING else look

    def release(self, descriptor: int) -> PendingConnection:
        """Removes and returns a waiting connection."""
        waiting = self._waiting.pop(descriptor)
        self._epoll.unregister(descriptor)
        return waiting

    def close(self) -> None:
        """Closes all waiting connections."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        for descriptor in tuple(self._waiting):
            self.release(descriptor).sock.close()
        self._epoll.close()

    def _look_at(self, sock: socket.socket) -> Look:
        try:
            first = sock.recv(LOOK_BYTES, socket.MSG_PEEK)
        except OSError:  # no bytes yet, or broken, which has its own event
            return _NOTHING
        look = self._look(first)
        return look._replace(is_ready=True) if len(first) >= LOOK_BYTES else look

    def _on_timeout(self) -> None:
        assert self._timeout_s is not None
        loop = asyncio.get_running_loop()
        latest_s = loop.time() - self._timeout_s
        for waiting in tuple(self._waiting.values()):
            if waiting.since_s > latest_s:
                self._timer = loop.call_at(waiting.since_s + self._timeout_s, self._on_timeout)
                return
            self.release(waiting.sock.fileno())
            self._expire(waiting)
        self._timer = None
