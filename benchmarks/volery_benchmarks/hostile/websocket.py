"""Provides a WebSocket client of one socket, for clients that misbehave as no library would.

Source: RFC 6455. Frames use the mask 0, so that the prepared bytes are sent unchanged.
"""

from __future__ import annotations

import socket
import struct

_HANDSHAKE = (
    "GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)
TEXT, BINARY = 0x81, 0x82


def open_websocket(
    port: int, *, receive_buffer: int | None = None, timeout_s: float = 10.0
) -> socket.socket:
    """Returns a socket after the handshake. Raises `OSError` if the server refuses it.

    `receive_buffer`: size of the system's receive buffer, bytes.
    """
    sock = socket.socket()
    try:
        if receive_buffer is not None:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        sock.settimeout(timeout_s)
        sock.connect(("127.0.0.1", port))
        sock.sendall(_HANDSHAKE.format(port=port).encode())
        answer = b""
        while b"\r\n\r\n" not in answer:
            part = sock.recv(1)  # not a byte of the first frame
            if not part:
                raise ConnectionRefusedError("the server ended the handshake")
            answer += part
        if b" 101 " not in answer.split(b"\r\n", 1)[0]:
            raise ConnectionRefusedError(answer[:100].decode(errors="replace"))
    except OSError:
        sock.close()
        raise
    return sock


def frame(payload: bytes, kind: int = TEXT) -> bytes:
    """Returns one whole client frame."""
    return frame_head(len(payload), kind) + payload


def frame_head(length: int, kind: int = TEXT) -> bytes:
    """Returns the header of a client frame."""
    if length < 126:
        head = struct.pack(">BB", kind, 0x80 | length)
    elif length < 1 << 16:
        head = struct.pack(">BBH", kind, 0x80 | 126, length)
    else:
        head = struct.pack(">BBQ", kind, 0x80 | 127, length)
    return head + bytes(4)


def read_frame(sock: socket.socket) -> bytes:
    """Returns the payload of the server's next frame. Raises `OSError` at the connection's end."""
    _, length = _exactly(sock, 2)
    if length == 126:
        (length,) = struct.unpack(">H", _exactly(sock, 2))
    elif length == 127:
        (length,) = struct.unpack(">Q", _exactly(sock, 8))
    return _exactly(sock, length)


def _exactly(sock: socket.socket, count: int) -> bytes:
    parts = bytearray()
    while len(parts) < count:
        part = sock.recv(count - len(parts))
        if not part:
            raise ConnectionResetError("the server ended the connection")
        parts += part
    return bytes(parts)
