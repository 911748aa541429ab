"""Provides the addresses of this machine to rosgraph without `netifaces`.

Debian's `python3-rosgraph` imports that package when a node with `ROS_HOSTNAME=localhost` connects
to another one, but neither depends on it nor works without it; a build for Debian's Python does not
work with another version.
"""

from __future__ import annotations

import fcntl
import importlib
import socket
import struct
from typing import Any

_SIOCGIFADDR = 0x8915
_NAME_BYTES = 16
_REQUEST_BYTES = 40
"""`struct ifreq` of linux/if.h: a name, then the address in a `sockaddr_in`."""
_ADDRESS = slice(20, 24)


def provide_local_addresses() -> None:
    """Makes rosgraph work if `netifaces` cannot be imported; call it after rospy is loaded.

    An importable `netifaces` stays loaded, even if its folder leaves `sys.path` later.
    """
    try:
        importlib.import_module("netifaces")
    except ImportError:
        network: Any = importlib.import_module("rosgraph.network")
        network.get_local_addresses = ipv4_addresses


def ipv4_addresses() -> list[str]:
    """Returns the first IPv4 address of each network interface that has one."""
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        for _, name in socket.if_nameindex():
            request = struct.pack(f"{_REQUEST_BYTES}s", name.encode()[: _NAME_BYTES - 1])
            try:
                answer = fcntl.ioctl(probe.fileno(), _SIOCGIFADDR, request)
            except OSError:  # no address
                continue
            found.append(socket.inet_ntoa(answer[_ADDRESS]))
    return found
