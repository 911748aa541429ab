"""Provides a listening TCP socket with limits, for every TCP server.

    listener = open_listener("127.0.0.1", 5760, "MAVLink TCP")
    server = await loop.create_server(make_protocol, sock=listener)
    ...
    listener.prove(transport)          # the client has sent a valid first frame

The limits apply where connections are accepted, so asyncio, uvicorn and websockets need no change.
A connection is unproven until its first valid frame. When there is no room, the oldest unproven
connection ends; without one, the new connection is refused. Both are counted and logged
occasionally. Out of file descriptors, asyncio's own loop would log a traceback for each attempt;
here a reserved descriptor serves to refuse the client.

A server whose clients send first gets a connection with its first request, see `Opening`.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import socket
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from volery.core.collector import collect_young
from volery.core.connection_limits import SHARED, ConnectionLimits
from volery.core.pending_connections import Look, PendingConnection, PendingConnections
from volery.core.rare_log import RareLog

UNIX = "unix:"
"""Prefix of a host that is the path of a Unix-domain socket."""
MAX_UNPROVEN = 64
"""Limit of one listener's connections without a valid frame (modelling choice)."""
_UNIX_FAMILY = getattr(socket, "AF_UNIX", None)
_BACKLOG = 128
_REFUSALS_A_TURN = 64
_READY_A_TURN = 4
"""New connections passed to the server before its existing ones get their turn again."""
_EVICTIONS_A_TURN = 16
"""After this number the server gets its turn, to close the ended connections."""
_ADMISSIONS_A_COLLECTION = 16
"""A client of rosbridge consists of some 230 objects: a collection takes some milliseconds."""
_NO_DESCRIPTORS = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
_PAUSE_S = 0.001
"""Pause of a server without any descriptor, which would spin otherwise."""
_log = logging.getLogger(__name__)


class Opening(NamedTuple):
    """How connections start when clients send first: they wait until `look` returns ready."""

    look: Callable[[bytes], Look]
    """Examines their first bytes."""
    timeout_s: float | None = None
    """Maximum waiting time; None: as long as there is room."""
    greeting: bytes = b""
    """Bytes sent to each connection at once."""


class Listener(socket.socket):
    """Accepts connections within limits. All methods are called in the server's thread.

    name: of the server, for logs. limits: shared with other servers. max_connections: limit of this
    listener, beyond which the oldest unproven connection ends; None: that of `limits`.
    max_unproven: see MAX_UNPROVEN; None: no limit, for servers whose clients may stay silent.
    opening: how connections start; None: the server gets them at once.
    """

    def __init__(
        self,
        family: int,
        name: str,
        limits: ConnectionLimits = SHARED,
        max_connections: int | None = None,
        max_unproven: int | None = MAX_UNPROVEN,
        opening: Opening | None = None,
    ) -> None:
        super().__init__(family, socket.SOCK_STREAM)
        self._name = name
        self._key = f"{name} {id(self)}"
        self._limits = limits
        self._max_connections = max_connections
        self._max_unproven = max_unproven
        self._open: dict[int, _Accepted] = {}
        self._unproven: dict[int, _Accepted] = {}
        """By file descriptor, oldest first."""
        self._evicted = 0
        """Number of ended connections that are not closed yet."""
        self._num_given = 0
        """Number of connections that the server has got in this turn."""
        self._num_admitted = 0
        self._reserve: int | None = os.open(os.devnull, os.O_RDONLY)
        self.refusals = RareLog(_log)
        """Refused and ended connections, by reason."""
        self._greeting = b"" if opening is None else opening.greeting
        self._room: PendingConnections | None = None
        if opening is not None and PendingConnections.is_available:
            number = super().fileno()
            self._room = PendingConnections(number, opening.look, opening.timeout_s, self._expire)

    def add_port(self) -> None:
        """Adds the port to the name in logs."""
        if self.family != _UNIX_FAMILY:
            self._name = f"{self._name}, port {self.getsockname()[1]}"

    def fileno(self) -> int:
        """Returns the descriptor that is readable when `accept` has work to do."""
        return super().fileno() if self._room is None else self._room.fileno()

    def accept(self) -> tuple[socket.socket, Any]:
        """Accepts a ready connection within the limits, like `socket.socket.accept`.

        Raises `BlockingIOError` if no connection is ready, or the server has to close some first.
        """
        accepted = self._next_accepted()
        if accepted is None:
            self._num_given = 0
            raise BlockingIOError(errno.EAGAIN, "none is ready, or others have their turn")
        self._num_given += 1
        self._num_admitted += 1
        if self._num_admitted % _ADMISSIONS_A_COLLECTION == 0:
            collect_young()
        return accepted

    def prove(self, connection: Any) -> None:
        """Marks `connection`, a socket or a transport, as proven by a valid frame."""
        self._unproven.pop(_descriptor_of(connection), None)

    def make_room_for(self, connection: Any) -> bool:
        """Ends the oldest other unproven connection; returns whether there was one.

        For servers with a limit of their own that send a client the reason for a refusal.
        """
        return self._evict("as many connections as may be", _descriptor_of(connection))

    def note_foreign_protocol(self, protocol: str) -> None:
        """Counts a connection that is ended because it speaks `protocol`, see `Preamble`."""
        self._note(f"ends connections that speak {protocol}: a web page, or a wrong port")

    def note_slow_client(self) -> None:
        """Counts a connection that is ended because its request did not arrive in time."""
        self._note("ends connections whose requests do not come in time")

    def close(self) -> None:
        """Stops listening; the server's connections stay open."""
        if self._room is not None:
            self._room.close()
        if self._reserve is not None:
            os.close(self._reserve)
            self._reserve = None
        super().close()

    def close_connections(self) -> None:
        """Closes all accepted connections, also one that no server object holds.

        `loop.sock_accept` loses a connection that it accepts just as its task is cancelled.
        """
        for accepted in tuple(self._open.values()):
            accepted.close()

    # ---------------------------------------------------------------------------------- internal

    def _next_accepted(self) -> tuple[socket.socket, Any] | None:
        """Returns the next connection; None: the server must do other work now."""
        with contextlib.suppress(BlockingIOError):
            for _ in range(_REFUSALS_A_TURN):
                if self._evicted >= _EVICTIONS_A_TURN or self._num_given >= _READY_A_TURN:
                    break
                accepted = self._accept_one() if self._room is None else self._attend(self._room)
                if accepted is not None:
                    return accepted
        return None

    def _attend(self, room: PendingConnections) -> tuple[socket.socket, Any] | None:
        """Handles one event; returns a connection that has become ready."""
        event = room.next_event()
        if event.descriptor not in room:
            accepted = self._accept_one()
            if accepted is not None:
                room.admit(*accepted)
            return None
        look = room.look(event)
        if look is not None and look.is_ready:
            waiting = room.release(event.descriptor)
            return waiting.sock, waiting.address
        if look is not None and look.foreign_protocol is not None:
            self.note_foreign_protocol(look.foreign_protocol)
        if look is None or look.foreign_protocol is not None:
            room.release(event.descriptor).sock.close()
        return None

    def _expire(self, waiting: PendingConnection) -> None:
        self.note_slow_client()
        waiting.sock.close()

    def _accept_one(self) -> tuple[socket.socket, Any] | None:
        """Accepts the next connection; None if the connection was refused."""
        try:
            descriptor, address = self._accept()  # type: ignore[attr-defined]
        except OSError as error:
            if error.errno not in _NO_DESCRIPTORS:
                raise
            self._refuse_blindly()
            return None
        accepted = _Accepted(self.family, self.type, self.proto, fileno=descriptor)
        reason = self._enter(accepted, str(address[0]) if address else UNIX)
        if reason is not None:
            self._note(f"refuses connections: there are {reason}")
            accepted.close()
            return None
        if self._greeting:
            with contextlib.suppress(OSError):  # already closed
                accepted.send(self._greeting)
        return accepted, address

    def _enter(self, accepted: _Accepted, address: str) -> str | None:
        """Makes room for a connection and counts it; or returns the reason for a refusal."""
        limit, unproven = self._max_connections, self._max_unproven
        if unproven is not None:
            unproven = min(unproven, max(1, self._limits.max_connections // 4))
            if len(self._unproven) >= unproven:
                self._evict(f"{unproven} without a valid request")
        if limit is not None and len(self._open) - self._evicted >= limit:
            full = f"{limit} connections"
            if not self._evict(full):
                return full
        reason = self._limits.enter(self._key, address)
        if reason is not None:
            self._evict(reason)  # room for the next connection; too late for this one
            return reason
        accepted.attach(self, address)
        self._open[accepted.fileno()] = self._unproven[accepted.fileno()] = accepted
        return None

    def _evict(self, reason: str, spared: int = -1) -> bool:
        """Ends the oldest unproven connection; returns whether there was one."""
        descriptor = next((number for number in self._unproven if number != spared), None)
        if descriptor is None:
            return False
        oldest = self._unproven.pop(descriptor)
        self._note(f"ends idle connections: there are {reason}")
        if self._room is not None and descriptor in self._room:
            self._room.release(descriptor).sock.close()
            return True
        oldest.is_evicted = True
        self._evicted += 1
        with contextlib.suppress(OSError):  # the client has disconnected
            oldest.shutdown(socket.SHUT_RDWR)  # its server sees the end of the stream
        return True

    def _refuse_blindly(self) -> None:
        """Refuses a client when out of descriptors, by briefly freeing the reserved one."""
        self._note("refuses connections: out of file descriptors")
        if self._reserve is None:
            time.sleep(_PAUSE_S)
        else:
            os.close(self._reserve)
            self._reserve = None
            with contextlib.suppress(OSError):
                os.close(self._accept()[0])  # type: ignore[attr-defined]
        with contextlib.suppress(OSError):
            self._reserve = os.open(os.devnull, os.O_RDONLY)

    def _note(self, text: str) -> None:
        self.refusals.note(f"{self._name}: {text}")

    def forget(self, accepted: _Accepted, descriptor: int, address: str) -> None:
        """Counts a connection as closed."""
        self._open.pop(descriptor, None)
        self._unproven.pop(descriptor, None)
        self._evicted -= accepted.is_evicted
        self._limits.leave(self._key, address)


class _Accepted(socket.socket):
    """A connection that notifies its listener when it is closed."""

    is_evicted = False
    _listener: Listener | None = None
    _address = ""

    def attach(self, listener: Listener, address: str) -> None:
        self._listener, self._address = listener, address

    def close(self) -> None:
        descriptor, listener, self._listener = self.fileno(), self._listener, None
        super().close()
        if listener is not None:
            listener.forget(self, descriptor, self._address)


def open_listener(
    host: str,
    port: int,
    name: str,
    *,
    limits: ConnectionLimits = SHARED,
    max_connections: int | None = None,
    max_unproven: int | None = MAX_UNPROVEN,
    opening: Opening | None = None,
) -> Listener:
    """Returns a socket that listens on the first address of `host`; port 0 takes a free one.

    Names such as `localhost` mean IPv4 if they have such an address; `unix:PATH` is a Unix-domain
    socket, which has no port. The other arguments are those of `Listener`. Raises `OSError` or
    `OverflowError` if the socket cannot listen.
    """
    family: int
    address: Any
    if host.startswith(UNIX):
        family, address = socket.AF_UNIX, host.removeprefix(UNIX)
    else:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        family, _, _, _, address = min(found, key=lambda entry: entry[0] != socket.AF_INET)
    listener = Listener(family, name, limits, max_connections, max_unproven, opening)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(address)
        listener.listen(_BACKLOG)
        listener.setblocking(False)
        listener.add_port()
    except BaseException:
        listener.close()
        raise
    return listener


def _descriptor_of(connection: Any) -> int:
    """Returns the file descriptor of a socket or asyncio transport; -1 if closed."""
    if hasattr(connection, "get_extra_info"):
        connection = connection.get_extra_info("socket")
    return -1 if connection is None else int(connection.fileno())
