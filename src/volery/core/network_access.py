"""What all servers and clients over TCP share: where they may listen, who is let in, sockets."""

from __future__ import annotations

import asyncio
import hmac
import socket
from typing import Any

from volery.core.errors import BridgeError

LOOPBACK = frozenset({"127.0.0.1", "::1", "localhost"})
PROBES = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 5, "TCP_KEEPCNT": 3}
"""The system asks a peer who is silent for 5 s, every 5 s, at most 3 times, whether it lives."""


def check_address(host: str, *, anywhere: bool, flag: str) -> None:
    """`BridgeError` for an address beyond loopback without the explicit consent `anywhere`.

    flag: how a user gives that consent.
    """
    if host in LOOPBACK or anywhere:
        return
    raise BridgeError(
        f"{host} can be reached from other machines, and whoever reaches it commands the UAVs; "
        f"allow that with {flag}, or listen on 127.0.0.1"
    )


def check_token(host: str, token: str | None) -> None:
    """`BridgeError` for an address beyond loopback where nobody would have to show a token."""
    if host not in LOOPBACK and not token:
        raise BridgeError(f"{host} can be reached from other machines: set a --token")


def shows_token(given: Any, token: str | None) -> bool:
    """Whether what was given is the token, told in the same time for every wrong one."""
    if token is None:
        return True
    return isinstance(given, str) and hmac.compare_digest(
        given.encode(errors="replace"), token.encode(errors="replace")
    )


def write_while_open(transport: asyncio.WriteTransport, data: bytes) -> None:
    """Write to a connection that has not ended.

    After a failed write asyncio tells its protocol only in the loop's next turn, and meanwhile
    prints a warning of each further write.
    """
    if not transport.is_closing():
        transport.write(data)


def tend(sock: socket.socket) -> None:
    """Send small messages at once, and notice a peer that vanished without a word."""
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in PROBES.items():
        if hasattr(socket, option):
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)
