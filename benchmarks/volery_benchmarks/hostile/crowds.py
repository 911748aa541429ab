"""Crowds of clients: a thousand with unfinished messages, and 120 that stop reading."""

from __future__ import annotations

import json
import resource
import select
import socket
import time
from collections.abc import Iterator
from contextlib import suppress

from volery_benchmarks.hostile.websocket import BINARY, frame, frame_head, open_websocket

VIEWERS = 990
"""Room for others remains in the 1,000 clients of a server."""
STOPPED_SUBSCRIBERS = 120
STOPPED_TOPICS = ("/uav1/odom", "/uav1/imu", "/tf", "/clock")
_ANNOUNCED_BYTES = 9_900_000
_FRAGMENT_BYTES = 250_000
_FRAGMENTS = 36
_CHUNK_BYTES = 1 << 16
_LOOK_S = 0.05


def unfinished(port: int, _ros_tcp: int, ends: float) -> int:
    """Sends 9 MB of fragments and of a message each with many clients, and completes nothing."""
    _allow_descriptors()
    viewers = [_Viewer(port, number) for number in range(VIEWERS)]
    sent = 0
    while time.monotonic() < ends:
        waiting = select.poll()
        by_number = {}
        for viewer in viewers:
            sock = viewer.connected(ends)
            if sock is not None and viewer.has_more:
                waiting.register(sock, select.POLLOUT)
                by_number[sock.fileno()] = viewer
        for number, _ in waiting.poll(1e3 * _LOOK_S):
            sent += by_number[number].send()
    return sent


def stopped(port: int, _ros_tcp: int, ends: float) -> int:
    """Subscribes to four topics with 120 clients that read for a second and then stop."""
    clients = [open_websocket(port) for _ in range(STOPPED_SUBSCRIBERS)]
    for client in clients:
        for topic in STOPPED_TOPICS:
            client.sendall(frame(json.dumps({"op": "subscribe", "topic": topic}).encode()))
    time.sleep(max(0.0, ends - time.monotonic()))
    return len(clients)


class _Viewer:
    """A client that sends as much as the server takes, and connects again when it is ended."""

    def __init__(self, port: int, number: int) -> None:
        self._port = port
        self._number = number
        self._sock: socket.socket | None = None
        self._rest: Iterator[bytes] = iter(())
        self._piece = memoryview(b"")
        self.has_more = True
        """Whether it has not sent everything yet."""

    def connected(self, ends: float) -> socket.socket | None:
        """Returns its connection, a new one if the last has ended; None if there is none."""
        if self._sock is not None and not self._is_ended(self._sock):
            return self._sock
        self._sock = None
        if time.monotonic() < ends:
            with suppress(OSError):
                self._sock = open_websocket(self._port, timeout_s=1.0)
                self._sock.setblocking(False)
                self._rest = self._pieces()
                self._piece = memoryview(next(self._rest))
                self.has_more = True
        return self._sock

    def send(self) -> int:
        """Sends what the server takes; returns the number of bytes."""
        assert self._sock is not None
        try:
            count = self._sock.send(self._piece)
        except OSError:
            return 0
        self._piece = self._piece[count:]
        if not self._piece:
            self._piece = memoryview(next(self._rest, b""))
            self.has_more = bool(self._piece)
        return count

    def _pieces(self) -> Iterator[bytes]:
        data = "x" * _FRAGMENT_BYTES
        for number in range(_FRAGMENTS):
            part = {"op": "fragment", "id": "f", "data": data, "num": number, "total": 100}
            yield frame(json.dumps(part).encode())
        yield frame_head(_ANNOUNCED_BYTES, BINARY)
        for _ in range(_ANNOUNCED_BYTES // _CHUNK_BYTES):
            yield bytes(_CHUNK_BYTES)

    @staticmethod
    def _is_ended(sock: socket.socket) -> bool:
        """Reads the server's messages; returns whether there will be none."""
        try:
            while True:
                if not sock.recv(_CHUNK_BYTES):
                    break
        except BlockingIOError:
            return False
        except OSError:
            pass
        sock.close()
        return True


def _allow_descriptors() -> None:
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
