"""Limits the connections of all servers of this process together.

Every connection uses a file descriptor, and so do logs, scenarios and compiled kernels. The limit
leaves them a quarter of the descriptors that the system grants (RLIMIT_NOFILE) and 32 more.
"""

from __future__ import annotations

import ipaddress
import resource
import threading
from collections import Counter

MAX_CONNECTIONS = 2048
"""Limit for all servers together, whatever the number of descriptors (modelling choice)."""
_MIN_CONNECTIONS = 8
_SPARE_DESCRIPTORS = 32


class ConnectionLimits:
    """Counts open connections by listener and address; thread-safe.

    max_connections: limit of the process; None: derived from its file descriptors at each
    connection. One listener may have three quarters of them, and so may one address except
    loopback, which all programs of this machine share.
    """

    def __init__(self, max_connections: int | None = None) -> None:
        self._max_connections = max_connections
        self._lock = threading.Lock()
        self._listeners: Counter[str] = Counter()
        self._addresses: Counter[str] = Counter()

    @property
    def max_connections(self) -> int:
        """Current limit of the process's connections."""
        return self._max_connections or connections_for(
            resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        )

    @property
    def num_connections(self) -> int:
        """Number of open connections."""
        with self._lock:
            return self._listeners.total()

    def enter(self, listener: str, address: str) -> str | None:
        """Counts a new connection, or returns the reason why there is no room."""
        limit = self.max_connections
        part = limit - limit // 4
        with self._lock:
            if self._listeners.total() >= limit:
                return f"{limit} connections to all ports"
            if self._listeners[listener] >= part:
                return f"{part} connections to this port"
            if self._addresses[address] >= part and not is_loopback(address):
                return f"{part} connections of one address"
            self._listeners[listener] += 1
            self._addresses[address] += 1
        return None

    def leave(self, listener: str, address: str) -> None:
        """Counts a connection as ended."""
        with self._lock:
            for counter, key in ((self._listeners, listener), (self._addresses, address)):
                counter[key] -= 1
                if counter[key] <= 0:
                    del counter[key]


def connections_for(descriptors: int) -> int:
    """Returns the limit of connections for a number of file descriptors."""
    if descriptors < 0:  # RLIM_INFINITY
        return MAX_CONNECTIONS
    wanted = descriptors - descriptors // 4 - _SPARE_DESCRIPTORS
    return min(MAX_CONNECTIONS, max(_MIN_CONNECTIONS, wanted))


def is_loopback(address: str) -> bool:
    """Returns whether an address is a loopback address."""
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return False
    mapped = getattr(found, "ipv4_mapped", None)
    return (mapped or found).is_loopback


SHARED = ConnectionLimits()
"""The limits of all servers of the process."""
