"""Frames between two machines of a divided run, after each has proved that it knows the token.

A frame is its length and a CBOR array whose first item names its kind. The token never crosses;
what follows is not encrypted, so the network must be trusted. Each end sends a sign of life every
second, from a thread of its own.
"""

from __future__ import annotations

import hmac
import secrets
import socket
import struct
import threading
from typing import Any

import cbor2

from volery.cluster.runs import difference
from volery.core.errors import DivisionError, reason_of
from volery.core.network_access import tend

Frame = list[Any]

GREETING_S = 10.0
"""Wall time for each frame before a machine is admitted, s."""
SILENCE_S = 8.0
"""Wall time without a sign of life after which a machine is lost, s."""
_SIGN_S = 1.0
_LENGTH = struct.Struct(">I")
_MAX_BYTES = 1 << 30
_MAX_GREETING_BYTES = 1 << 16
_CHUNK_BYTES = 1 << 20
_SIGN = _LENGTH.pack(0)


class LinkError(DivisionError):
    """Another machine of a divided run is lost, or does not fit."""


class RefusedError(LinkError):
    """A worker does not know the token, or has other versions."""


class Link:
    """A connection to another machine; one thread receives, any thread sends."""

    def __init__(self, connection: socket.socket, name: str) -> None:
        self.name = name
        self._socket = connection
        connection.settimeout(GREETING_S)
        if connection.family != socket.AF_UNIX:
            tend(connection)
        self._max_bytes = _MAX_GREETING_BYTES
        self._sending = threading.Lock()
        self._closed = threading.Event()

    def send(self, *frame: Any) -> None:
        """Sends a frame. Raises `LinkError` if the other machine is lost."""
        self.send_bytes(cbor2.dumps(frame))

    def send_bytes(self, encoded: bytes) -> None:
        """Sends a frame that is encoded already. Raises `LinkError` like `send`."""
        self._write(_LENGTH.pack(len(encoded)) + encoded)

    def receive(self) -> Frame:
        """Returns the next frame. Raises `LinkError` if the other machine is lost."""
        while True:
            size = _LENGTH.unpack(self._read(_LENGTH.size))[0]
            if size > self._max_bytes:
                raise LinkError(f"{self.name} sends no frames of a divided run")
            if size:
                return self._decoded(self._read(size))

    def show_life(self) -> None:
        """Sends signs of life from now on, and accepts large frames."""
        self._max_bytes = _MAX_BYTES
        self._socket.settimeout(SILENCE_S)
        threading.Thread(target=self._show_life, name="signs of life", daemon=True).start()

    def close(self) -> None:
        """Ends the connection."""
        self._closed.set()
        self._socket.close()

    def _show_life(self) -> None:
        while not self._closed.wait(_SIGN_S):
            try:
                self._write(_SIGN)
            except LinkError:
                return

    def _write(self, data: bytes) -> None:
        with self._sending:
            try:
                self._socket.sendall(data)
            except OSError as error:
                raise LinkError(f"{self.name} is lost: {_reason(error)}") from None

    def _read(self, size: int) -> bytearray:
        data = bytearray(size)
        view = memoryview(data)
        while view:
            try:
                count = self._socket.recv_into(view[:_CHUNK_BYTES])
            except OSError as error:
                raise LinkError(f"{self.name} is lost: {_reason(error)}") from None
            if not count:
                raise LinkError(f"{self.name} is lost: it ended the connection")
            view = view[count:]
        return data

    def _decoded(self, data: bytearray) -> Frame:
        try:
            frame = cbor2.loads(data)
        except (cbor2.CBORDecodeError, ValueError) as error:
            raise LinkError(f"{self.name} sends a broken frame: {error}") from None
        if not (isinstance(frame, list) and frame):
            raise LinkError(f"{self.name} sends a broken frame")
        return frame


def admit(link: Link, token: str, versions: dict[str, str]) -> None:
    """Admits a worker that knows the token and has the leader's versions.

    Raises `RefusedError` for another one, after sending it the reason, and `LinkError` for what
    is none.
    """
    nonce = secrets.token_bytes(32)
    link.send("leader", nonce)
    kind, *rest = link.receive()
    if kind != "worker" or len(rest) != 3 or not isinstance(rest[0], bytes):
        raise LinkError(f"{link.name} is no worker of a divided run")
    other_nonce, proof, others = rest
    if not _is_proof(proof, token, b"worker", nonce, other_nonce):
        _refuse(link, "the token is wrong")
    if differs := difference(versions, others):
        _refuse(link, f"it has {differs}")
    link.send("welcome", _proof(token, b"leader", nonce, other_nonce))


def apply_to(link: Link, token: str, versions: dict[str, str]) -> None:
    """Shows a leader that this worker knows the token. Raises `LinkError` if it is refused."""
    kind, *rest = link.receive()
    if kind != "leader" or len(rest) != 1 or not isinstance(rest[0], bytes):
        raise LinkError(f"{link.name} is no leader of a divided run")
    nonce = secrets.token_bytes(32)
    link.send("worker", nonce, _proof(token, b"worker", rest[0], nonce), versions)
    kind, *answer = link.receive()
    if kind != "welcome" or len(answer) != 1:
        raise LinkError(f"{link.name} refuses this worker: {''.join(map(str, answer))[:400]}")
    if not _is_proof(answer[0], token, b"leader", rest[0], nonce):
        raise LinkError(f"{link.name} does not know the token")


def _refuse(link: Link, reason: str) -> None:
    link.send("refused", reason)
    raise RefusedError(f"{link.name} was refused: {reason}")


def _proof(token: str, role: bytes, first: bytes, second: bytes) -> bytes:
    return hmac.digest(token.encode(), role + first + second, "sha256")


def _is_proof(given: Any, token: str, role: bytes, first: bytes, second: bytes) -> bool:
    return isinstance(given, bytes) and hmac.compare_digest(
        given, _proof(token, role, first, second)
    )


def _reason(error: OSError) -> str:
    if isinstance(error, TimeoutError):
        return "no sign of life"
    return reason_of(error)
