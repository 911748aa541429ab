"""Port numbers that stay a test's own while no server listens there yet, or any more."""

from __future__ import annotations

import contextlib
import socket


@contextlib.contextmanager
def held_port():
    """A TCP port of 127.0.0.1 that refuses connections until a server is started there by number.

    The system gives it to no other process, no test process either: a socket that does not
    listen keeps it. A server with SO_REUSEADDR, as servers set it, can listen there all the same.
    """
    with socket.socket() as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        sock.bind(("127.0.0.1", 0))
        yield sock.getsockname()[1]
