"""Blocks remote packets for a participant that is limited to this machine.

Cyclone DDS sends through its configured interfaces, but its sockets receive from all of them. Those
of a participant on loopback are therefore bound to that device.
"""

from __future__ import annotations

import ctypes
import logging
import os
import socket
from pathlib import Path

_BASE_PORT, _PORTS_A_DOMAIN = 7400, 250  # RTPS 2.5, 9.6.2.3
_LOOPBACK = b"lo\0"
_TABLES = ("udp", "udp6")
_LOCAL_ADDRESS, _INODE = 1, 9
"""Columns of those tables (Linux, `proc_net_udp`)."""

_log = logging.getLogger(__name__)


def confine(domain_id: int) -> int:
    """Binds this process's sockets of a domain to loopback; returns their number."""
    first = _BASE_PORT + _PORTS_A_DOMAIN * domain_id
    own = _own_sockets()
    numbers = [own[inode] for inode in _bound_within(first) if inode in own]
    for number in numbers:
        try:
            _bind_to_loopback(number)
        except OSError as error:
            _log.warning(
                "DDS domain %d: its sockets cannot be bound to loopback (%s); a firewall should "
                "keep UDP ports %d to %d",
                domain_id,
                error,
                first,
                first + _PORTS_A_DOMAIN - 1,
            )
    return len(numbers)


def _bind_to_loopback(number: int) -> None:
    """Calls the C function: a `socket.socket` around it would set Python's default timeout."""
    libc = ctypes.CDLL(None, use_errno=True)
    level, option = socket.SOL_SOCKET, socket.SO_BINDTODEVICE
    if libc.setsockopt(number, level, option, _LOOPBACK, len(_LOOPBACK)) != 0:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error))


def _bound_within(first: int) -> list[str]:
    """Returns inodes of the machine's UDP sockets that are bound to ports of the domain."""
    found = []
    for table in _TABLES:
        path = Path("/proc/self/net") / table
        lines = path.read_text().splitlines()[1:] if path.exists() else []
        for columns in map(str.split, lines):
            port = int(columns[_LOCAL_ADDRESS].rpartition(":")[2], 16)
            if first <= port < first + _PORTS_A_DOMAIN:
                found.append(columns[_INODE])
    return found


def _own_sockets() -> dict[str, int]:
    """Returns file descriptors of this process's sockets by inode."""
    found = {}
    for name in os.listdir("/proc/self/fd"):
        try:
            target = os.readlink(f"/proc/self/fd/{name}")
        except OSError:  # closed meanwhile
            continue
        if target.startswith("socket:["):
            found[target[len("socket:[") : -1]] = int(name)
    return found
