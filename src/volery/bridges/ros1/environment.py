"""Finds rospy: in the running environment, in a sourced ROS, or where Debian installs it.

It works without `netifaces`: the addresses of this machine are read here.
"""

from __future__ import annotations

import fcntl
import importlib
import importlib.util
import logging
import os
import socket
import struct
import sys
import threading
from functools import cache
from pathlib import Path
from typing import Any

from volery.core.errors import BridgeError
from volery.graph.nodes.imports import forget_message_packages, withdraw_ros_imports

_DEBIAN = Path("/usr/lib/python3/dist-packages")
_PACKAGES = "python3-rospy python3-rosmaster ros-std-msgs"
_SIOCGIFADDR = 0x8915
_NAME_BYTES = 16
_REQUEST_BYTES = 40
"""`struct ifreq` of linux/if.h: a name, then the address in a `sockaddr_in`."""
_ADDRESS = slice(20, 24)
_lock = threading.Lock()


def load_rospy() -> Any:
    """Returns the module `rospy`, imported on first use.

    Raises
    ------
    BridgeError
        rospy is not installed, or this Python cannot load it.

    """
    with _lock:
        return _load()


def rospy_is_installed() -> bool:
    """Returns whether `load_rospy` can find rospy."""
    return importlib.util.find_spec("rospy") is not None or bool(_folders())


@cache
def _load() -> Any:
    withdraw_ros_imports()  # rospy imports ROS 1's own messages
    added = [] if importlib.util.find_spec("rospy") else _folders()
    # At the end, and only for now: packages of this environment must win, numpy above all.
    sys.path.extend(added)
    logger_class, before = logging.getLoggerClass(), set(sys.modules)
    try:
        rospy = importlib.import_module("rospy")
        _provide_local_addresses()
    except ImportError as error:
        raise BridgeError(
            f"ROS 1 needs rospy, which cannot be loaded ({error}); on Debian: "
            f"apt-get install --no-install-recommends {_PACKAGES}"
        ) from None
    else:
        return rospy
    finally:
        logging.setLoggerClass(logger_class)  # rospy's own class is meant for its nodes alone
        for folder in added:
            sys.path.remove(folder)
        # rospy keeps its imports; node files must find Volery's messages
        forget_message_packages(set(sys.modules) - before)


def _folders() -> list[str]:
    """Returns folders outside of this environment with rospy and its imports."""
    distribution = os.environ.get("ROS_DISTRO", "noetic")
    sourced = Path("/opt/ros") / distribution / "lib/python3/dist-packages"
    for folder in (sourced, _DEBIAN):
        if (folder / "rospy" / "__init__.py").is_file():
            return list(dict.fromkeys((str(folder), str(_DEBIAN))))
    return []


def _provide_local_addresses() -> None:
    """Makes rosgraph work if `netifaces` cannot be imported; call it after rospy is loaded.

    Debian's `python3-rosgraph` imports that package when a node with `ROS_HOSTNAME=localhost`
    connects to another one, but neither depends on it nor works without it; a build for Debian's
    Python does not work with another version. An importable `netifaces` stays loaded, even if its
    folder leaves `sys.path` later.
    """
    try:
        importlib.import_module("netifaces")
    except ImportError:
        network: Any = importlib.import_module("rosgraph.network")
        network.get_local_addresses = _ipv4_addresses


def _ipv4_addresses() -> list[str]:
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
