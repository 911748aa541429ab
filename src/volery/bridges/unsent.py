"""Limits how much the operating system buffers for a client that does not read."""

from __future__ import annotations

import socket

MAX_UNSENT_BYTES = 256 << 10
"""Linux would buffer 4 MB, and 50 clients that do not read would be served for half a minute before
they count as stalled."""


def bound_unsent(sock: socket.socket) -> None:
    """Limits the bytes that have not been sent yet to `MAX_UNSENT_BYTES`.

    Bytes in transit to a reader are not limited. Connections that a listening socket accepts
    inherit the limit.
    """
    is_tcp = sock.family in (socket.AF_INET, socket.AF_INET6)
    if is_tcp and hasattr(socket, "TCP_NOTSENT_LOWAT"):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, MAX_UNSENT_BYTES)
