"""How much the operating system takes of what is written to a client that does not read."""

from __future__ import annotations

import socket

MAX_UNSENT_BYTES = 256 << 10
"""Linux would take 4 MB, and 50 clients that do not read would be served for half a minute before
they count as stalled."""


def bound_unsent(sock: socket.socket) -> None:
    """Let `MAX_UNSENT_BYTES` wait that have not been sent yet, and no more.

    What is under way to a reader is not bounded by that. Connections that a listening socket
    accepts have what it has.
    """
    if hasattr(socket, "TCP_NOTSENT_LOWAT"):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, MAX_UNSENT_BYTES)
