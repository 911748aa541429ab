"""Keeps what others send from afar out of a participant that shall stay on this machine.

Cyclone DDS sends through the interfaces it is given, but its sockets hear all of them. Those of a
participant on loopback are therefore bound to that device.
"""

from __future__ import annotations

import logging
import os
import socket
import stat

_BASE_PORT, _PORTS_A_DOMAIN = 7400, 250  # RTPS 2.5, 9.6.2.3
_LOOPBACK = b"lo\0"

_log = logging.getLogger(__name__)


def confine(domain_id: int) -> int:
    """Bind this process's sockets of a domain to loopback; how many there are."""
    first = _BASE_PORT + _PORTS_A_DOMAIN * domain_id
    count = 0
    for number in _socket_numbers():
        try:
            with socket.socket(fileno=os.dup(number)) as same:  # closing it leaves theirs open
                if _is_of_domain(same, first):
                    same.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, _LOOPBACK)
                    count += 1
        except OSError as error:
            _log.warning(
                "DDS domain %d: its sockets cannot be bound to loopback (%s); a firewall should "
                "keep UDP ports %d to %d",
                domain_id,
                error,
                first,
                first + _PORTS_A_DOMAIN - 1,
            )
    return count


def _is_of_domain(sock: socket.socket, first: int) -> bool:
    if sock.type != socket.SOCK_DGRAM or sock.family not in (socket.AF_INET, socket.AF_INET6):
        return False
    return first <= int(sock.getsockname()[1]) < first + _PORTS_A_DOMAIN


def _socket_numbers() -> list[int]:
    """Open files of this process that are sockets."""
    found = []
    for name in os.listdir("/proc/self/fd"):
        try:
            if stat.S_ISSOCK(os.fstat(int(name)).st_mode):
                found.append(int(name))
        except OSError:  # it has closed meanwhile
            continue
    return found
