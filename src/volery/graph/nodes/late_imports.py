"""Offers the stand-ins for ROS's packages to scripts that import Volery.

`import volery`, then `from avoid import Avoid`: the file of a ROS 2 node is imported before any
scenario loads a node. Therefore `import volery` adds a last entry to the import path, which imports
the stand-ins when a package of ROS is found nowhere else.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

PYTHON_PACKAGES = (
    "rclpy",
    "message_filters",
    "sensor_msgs_py",
    "tf2_geometry_msgs",
    "tf2_py",
    "tf2_ros",
    "tf_transformations",
)
"""Packages without message types; the stand-ins have the most usual parts of them."""
_MESSAGES = ("_msgs", "_srvs", "_interfaces")
"""Ends of the names of packages of messages."""


class _LateFinder(MetaPathFinder):
    """Provides the stand-ins when the first of them is imported."""

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,
        target: ModuleType | None = None,
    ) -> ModuleSpec | None:
        """Implements `MetaPathFinder`; returns None for packages that are not ROS's."""
        if "." in fullname or not (fullname in PYTHON_PACKAGES or fullname.endswith(_MESSAGES)):
            return None
        imports = import_module("volery.graph.nodes.imports")  # which imports all messages
        found: ModuleSpec | None = imports.find_stand_in(fullname, path, target)
        return found


_FINDER = _LateFinder()


def offer() -> None:
    """Adds the stand-ins at the end of the import path."""
    sys.meta_path.append(_FINDER)


def withdraw() -> None:
    """Removes the entry, so that a package of ROS that is missing is missing."""
    if _FINDER in sys.meta_path:
        sys.meta_path.remove(_FINDER)
