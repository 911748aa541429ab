"""Connects to ROS-TCP endpoints."""

from __future__ import annotations

import asyncio
import socket

KEEPALIVE_S = 1.0
"""Seconds without a frame after which Unity's Connector sends a keepalive."""
FIRST_PAUSE_S = 0.2
LONGEST_PAUSE_S = 5.0
"""Largest pause between two attempts; pauses double up to it."""
_CONNECT_S = 5.0
_UNANSWERED_MS = 15_000
"""Time for which sent bytes may stay unacknowledged before the endpoint counts as gone, ms."""


async def dial(host: str, port: int) -> socket.socket:
    """Returns a connected socket. Raises `OSError` or `TimeoutError` if no server answers."""
    loop = asyncio.get_running_loop()
    (family, *_, address), *_ = await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    sock = socket.socket(family, socket.SOCK_STREAM)
    try:
        sock.setblocking(False)
        async with asyncio.timeout(_CONNECT_S):  # unlike wait_for it never loses a cancellation
            await loop.sock_connect(sock, address)
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNANSWERED_MS)
    except BaseException:
        sock.close()
        raise
    return sock
