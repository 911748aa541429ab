"""Controls access over TCP, for all servers and clients: addresses, tokens, socket options."""

from __future__ import annotations

import asyncio
import hmac
import socket
from typing import Any

from volery.core.errors import BridgeError

LOOPBACK = frozenset({"127.0.0.1", "::1", "localhost"})
PROBES = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 5, "TCP_KEEPCNT": 3}
"""TCP keepalive: a peer silent for 5 s is probed every 5 s, at most 3 times."""


def check_address(host: str, *, anywhere: bool, flag: str) -> None:
    """Raises `BridgeError` for an address beyond loopback without the consent `anywhere`.

    flag: the option that gives the consent.
    """
    if host in LOOPBACK or anywhere:
        return
    raise BridgeError(
        f"{host} can be reached from other machines, whose clients could command the UAVs; "
        f"allow that with {flag}, or listen on 127.0.0.1"
    )


def check_token(host: str, token: str | None) -> None:
    """Raises `BridgeError` for an address beyond loopback without a token."""
    if host not in LOOPBACK and not token:
        raise BridgeError(f"{host} can be reached from other machines: set a --token")


def shows_token(given: Any, token: str | None) -> bool:
    """Returns whether `given` is the token, in constant time."""
    if token is None:
        return True
    return isinstance(given, str) and hmac.compare_digest(
        given.encode(errors="replace"), token.encode(errors="replace")
    )


def write_while_open(transport: asyncio.WriteTransport, data: bytes) -> None:
    """Writes to a connection that has not ended.

    After a failed write, asyncio notifies its protocol only in the loop's next turn, and meanwhile
    prints a warning for each further write.
    """
    if not transport.is_closing():
        transport.write(data)


def tend(sock: socket.socket) -> None:
    """Sends small messages at once, and detects a peer that vanished silently.

    A Unix-domain socket does so by itself.
    """
    if sock.family not in (socket.AF_INET, socket.AF_INET6):
        return
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for option, value in PROBES.items():
        if hasattr(socket, option):
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)
