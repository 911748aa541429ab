"""A port for a server that has to be where it was, or whose number has to be known before."""

import itertools
import os
import socket

_PER_PROCESS = 20
_numbers = itertools.count()


def own_port():
    """A free port below those that the system hands out for port 0; other processes get others."""
    first = 10_000 + _PER_PROCESS * (os.getpid() % 1000)
    for _ in range(_PER_PROCESS):
        port = first + next(_numbers) % _PER_PROCESS
        try:
            socket.create_server(("127.0.0.1", port)).close()
        except OSError:
            continue
        return port
    raise AssertionError(f"no free port from {first} on")
