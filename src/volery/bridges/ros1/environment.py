"""Finds rospy: in the running environment, in a sourced ROS, or where Debian installs it."""

from __future__ import annotations

import importlib
import importlib.util
import logging
import os
import sys
import threading
from functools import cache
from pathlib import Path
from typing import Any

from volery.bridges.ros1.local_addresses import provide_local_addresses
from volery.core.errors import BridgeError
from volery.graph.nodes.imports import forget_message_packages, withdraw_ros_imports

_DEBIAN = Path("/usr/lib/python3/dist-packages")
_PACKAGES = "python3-rospy python3-rosmaster ros-std-msgs"
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
        provide_local_addresses()
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
