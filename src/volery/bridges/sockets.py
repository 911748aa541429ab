"""What every TCP connection of a door has in common."""

from __future__ import annotations

import socket

PROBES = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 5, "TCP_KEEPCNT": 3}
"""The kernel asks a peer who is silent for 5 s, every 5 s, at most 3 times, whether it lives."""


def tend(sock: socket.socket) -> None:
    """Send small messages at once, and notice a peer that vanished without a word."""
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in PROBES.items():
        if hasattr(socket, option):
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)
