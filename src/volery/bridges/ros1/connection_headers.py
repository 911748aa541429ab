"""Accepts TCPROS connections and passes each on after its connection header has arrived.

rospy reads the header in the thread that accepts, without a limit of time or size: one silent
connection blocks all later subscribers. Here headers arrive in the sockets' own buffers, so that no
thread waits for a particular client.

Source: wiki.ros.org/ROS/Connection%20Header (length of 4 bytes, little endian, then the fields).
"""

from __future__ import annotations

import os
import selectors
import socket
import struct
import time
from collections.abc import Callable
from typing import Any

from volery.core.listener import Listener

HEADER_S = 5.0
"""Time within which a header must arrive (modelling choice)."""
MAX_HEADER_BYTES = 64 << 10
"""Largest header: subscribers send the message definition in it, some kilobytes."""
_LENGTH = struct.Struct("<I")
_FULL_PAUSE_S = 0.05
"""Pause between two attempts to accept while there is no room."""

Take = Callable[[socket.socket, Any], object]
"""Handles a connection, whose header can be read without waiting, and the client's address."""


class HeaderServer:
    """Serves one listener in the thread that calls `run`.

    take: called in that thread. header_s: see HEADER_S.
    """

    def __init__(self, listener: Listener, take: Take, header_s: float = HEADER_S) -> None:
        self._listener = listener
        self._take = take
        self._header_s = header_s
        self._waiting: dict[socket.socket, _Waiting] = {}
        """In the order of their deadlines."""
        self._wake_up = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._is_stopping = False

    def run(self) -> None:
        """Accepts until `stop`; then closes the listener and the waiting connections."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._wake_up, selectors.EVENT_READ)
            selector.register(self._listener, selectors.EVENT_READ)
            while True:
                ready = [key.fileobj for key, _ in selector.select(self._timeout_s())]
                if self._is_stopping:
                    break
                for connection in ready:
                    if connection is self._listener:
                        self._accept(selector)
                    elif isinstance(connection, socket.socket):
                        self._look(connection, selector)
                self._drop_late(selector)
        for connection in self._waiting:
            connection.close()
        self._listener.close()

    def stop(self) -> None:
        """Ends `run` soon; any thread may call it."""
        self._is_stopping = True
        os.eventfd_write(self._wake_up, 1)

    # ---------------------------------------------------------------------------------- internal

    def _timeout_s(self) -> float | None:
        for waiting in self._waiting.values():
            return max(0.0, waiting.deadline_s - time.monotonic())
        return None

    def _accept(self, selector: selectors.BaseSelector) -> None:
        try:
            connection, address = self._listener.accept()
        except BlockingIOError:
            return
        except OSError:
            time.sleep(_FULL_PAUSE_S)
            return
        connection.setblocking(True)
        self._waiting[connection] = _Waiting(address, time.monotonic() + self._header_s)
        _wake_at(connection, _LENGTH.size)
        selector.register(connection, selectors.EVENT_READ)

    def _look(self, connection: socket.socket, selector: selectors.BaseSelector) -> None:
        """Passes a connection on if its header has arrived; drops it if none can arrive."""
        waiting = self._waiting[connection]
        try:
            have = connection.recv(waiting.wanted, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except OSError:
            have = b""
        if len(have) < waiting.wanted:  # the client has disconnected
            self._drop(connection, selector)
        elif waiting.wanted == _LENGTH.size:
            (length,) = _LENGTH.unpack(have)
            if 0 < length <= MAX_HEADER_BYTES:
                waiting.wanted = _LENGTH.size + length
                _wake_at(connection, waiting.wanted)
            else:
                self._listener.note_foreign_protocol("anything but TCPROS")
                self._drop(connection, selector)
        else:
            _wake_at(connection, 1)
            selector.unregister(connection)
            del self._waiting[connection]
            self._listener.prove(connection)
            self._take(connection, waiting.address)

    def _drop_late(self, selector: selectors.BaseSelector) -> None:
        now_s = time.monotonic()
        for connection, waiting in tuple(self._waiting.items()):
            if waiting.deadline_s > now_s:
                return
            self._listener.note_slow_client()
            self._drop(connection, selector)

    def _drop(self, connection: socket.socket, selector: selectors.BaseSelector) -> None:
        selector.unregister(connection)
        del self._waiting[connection]
        connection.close()


class _Waiting:
    """A connection whose header is incomplete: first its length, then the whole header."""

    def __init__(self, address: Any, deadline_s: float) -> None:
        self.address = address
        self.deadline_s = deadline_s
        self.wanted = _LENGTH.size


def _wake_at(connection: socket.socket, num_bytes: int) -> None:
    """Makes the selector report the connection once after so many bytes, or after its end."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, num_bytes)
