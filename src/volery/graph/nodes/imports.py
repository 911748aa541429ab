"""Provides stand-ins for ROS's Python packages, so that ROS 2 node files run without ROS.

`from geometry_msgs.msg import Twist`, `from std_srvs.srv import Trigger` and `from rclpy.node
import Node` work after `provide_ros_imports`, which loading a node calls. A sourced ROS 2 takes
precedence; otherwise the stand-ins do, even where ROS 1 is installed: its packages have the same
names, and no node can publish its messages. Code that loads a real ROS later calls
`withdraw_ros_imports` first.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

from volery.core.errors import GraphError
from volery.graph.messages import message_type
from volery.graph.typestore import typestore

_KINDS = ("msg", "srv", "action")
PYTHON_PACKAGES = (
    "cv_bridge",
    "rclpy",
    "message_filters",
    "sensor_msgs_py",
    "tf2_geometry_msgs",
    "tf2_py",
    "tf2_ros",
    "tf2_sensor_msgs",
    "tf_transformations",
)
"""Packages without message types; the stand-ins have the most usual parts of them."""

_ROS1_PACKAGES = ("actionlib", "dynamic_reconfigure", "roslib", "rosparam", "rospy", "tf")
_ROS2_PACKAGES = (
    "ament_index_python",
    "interactive_markers",
    "launch",
    "launch_ros",
    "nav2_simple_commander",
    "ros2_numpy",
    "rosbag2_py",
    "rosidl_runtime_py",
)
"""Packages without message types that published nodes import and that have no stand-in."""
_MESSAGE_ENDINGS = ("_interfaces", "_msgs", "_srvs")


class _Finder(MetaPathFinder):
    """Finds `rclpy`, `tf2_ros`, their modules, and the packages of all known message types."""

    def find_spec(
        self,
        fullname: str,
        path: Sequence[str] | None,
        target: ModuleType | None = None,  # noqa: ARG002
    ) -> ModuleSpec | None:
        """Implements `MetaPathFinder`; returns None below packages that are not stand-ins."""
        package, _, rest = fullname.partition(".")
        if rest and getattr(path, "stand_in", None) is None:
            return None
        filler = _filler(package, rest)
        if filler is None:
            return None
        is_package = not rest or any(name.startswith(f"{fullname}.") for name in _parts(package))
        return ModuleSpec(fullname, _Loader(filler), is_package=is_package)


class _Path(list[str]):
    """`__path__` of a stand-in, which identifies its submodules."""

    stand_in = True


class _Loader(Loader):
    """Creates the contents of a module."""

    def __init__(self, fill: Callable[[ModuleType], None]) -> None:
        self._fill = fill

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:  # noqa: ARG002
        """Returns None: the default module."""
        return None

    def exec_module(self, module: ModuleType) -> None:
        """Fills the module."""
        if hasattr(module, "__path__"):
            module.__path__ = _Path()
        self._fill(module)


_FINDER = _Finder()


def provide_ros_imports() -> None:
    """Adds the stand-ins to the import path: after a sourced ROS 2, else first."""
    if _FINDER not in sys.meta_path:
        has_ros2 = PathFinder.find_spec("rclpy") is not None
        sys.meta_path.insert(len(sys.meta_path) if has_ros2 else 0, _FINDER)


def find_stand_in(
    name: str, path: Sequence[str] | None, target: ModuleType | None
) -> ModuleSpec | None:
    """Returns the stand-in for a package that is not installed; provides all if there is one."""
    found = _FINDER.find_spec(name, path, target)
    if found is not None:
        provide_ros_imports()
    return found


def advice_for_missing(name: str) -> str:
    """Returns what to do about a missing package of ROS, to append to an error; else empty."""
    package = name.partition(".")[0]
    if package in _ROS1_PACKAGES:
        return (
            "; this is a node of ROS 1: run it beside the simulation with --bridge ros1 "
            "(docs/bridges.md), or derive it from rclpy.node.Node"
        )
    if package in _ROS2_PACKAGES:
        return f"; Volery has no stand-in for {package} (docs/nodes.md lists those that it has)"
    if package.endswith(_MESSAGE_ENDINGS):
        return (
            f"; name a folder with the .msg files of {package} in message_packages, or with "
            "volery node --messages (docs/ros2.md)"
        )
    return ""


def withdraw_ros_imports() -> None:
    """Removes the stand-ins from the import path; imported stand-ins remain usable."""
    sys.meta_path[:] = [
        each
        for each in sys.meta_path
        if each is not _FINDER and not hasattr(each, "offers_ros")  # that of `import volery`
    ]
    for name, module in list(sys.modules.items()):
        if isinstance(getattr(getattr(module, "__spec__", None), "loader", None), _Loader):
            del sys.modules[name]


def forget_message_packages(names: Iterable[str]) -> None:
    """Removes modules that hold ROS messages, so that the next import searches again.

    For packages of ROS 1, after their users have imported them.
    """
    packages = {name.partition("/")[0] for name in typestore().names()}
    for name in names:
        if name.partition(".")[0] in packages:
            sys.modules.pop(name, None)


def _filler(package: str, rest: str) -> Callable[[ModuleType], None] | None:
    """Returns the function that fills a module; None for other modules."""
    if package in PYTHON_PACKAGES:
        name = f"{package}.{rest}" if rest else package
        return (lambda module: _fill(module, name)) if name in _modules() else None
    names = [name for name in typestore().names() if name.startswith(f"{package}/")]
    if not names or rest not in ("", *_KINDS):
        return None
    if not rest:
        return lambda _module: None
    parts = {_root(name, rest) for name in names if name.split("/")[1] == rest}
    return lambda module: _fill_types(module, package, rest, sorted(parts))


@cache
def _modules() -> dict[str, dict[str, Any]]:
    from volery.graph.nodes import (  # import the node
        cv_bridge,
        message_filters,
        point_cloud2,
        qos_events,
        rclpy_modules,
        tf2,
        tf_transformations,
        transformed_messages,
    )

    parts: tuple[Any, ...] = (rclpy_modules, qos_events, tf2, transformed_messages)
    parts += (tf_transformations, message_filters, point_cloud2, cv_bridge)
    joined: dict[str, dict[str, Any]] = {}
    for part in parts:
        joined |= part.contents()
    return joined


def _parts(package: str) -> Iterable[str]:
    """Returns the modules of a package without message types."""
    return _modules() if package in PYTHON_PACKAGES else ()


def _fill(module: ModuleType, name: str) -> None:
    """Fills a module; `rclpy.time` and the like are there after `import rclpy`, as in ROS 2."""

    def find(part: str) -> Any:
        if f"{name}.{part}" not in _modules():
            raise AttributeError(f"Volery's module '{name}' has no '{part}' (docs/nodes.md)")
        return import_module(f"{name}.{part}")

    vars(module).update(_modules()[name])
    module.__getattr__ = find  # type: ignore[method-assign]


def _root(name: str, kind: str) -> str:
    last = name.split("/")[2]
    return last if kind == "msg" else last.split("_")[0]


def _fill_types(module: ModuleType, package: str, kind: str, names: list[str]) -> None:
    def find(name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        try:
            found = _type(package, kind, name)
        except (KeyError, GraphError):
            raise AttributeError(f"{package}.{kind} has no type '{name}'") from None
        setattr(module, name, found)
        return found

    module.__getattr__ = find  # type: ignore[method-assign]
    module.__all__ = names  # type: ignore[attr-defined]


@cache
def _type(package: str, kind: str, name: str) -> Any:
    """Returns the class of a message, or a class with the messages of a service or action."""
    full = f"{package}/{kind}/{name}"
    if kind == "msg":
        return message_type(full)
    parts = ("Request", "Response") if kind == "srv" else ("Goal", "Result", "Feedback")
    found: dict[str, Any] = {part: message_type(f"{full}_{part}") for part in parts}
    mark = "__srvtype__" if kind == "srv" else "__actiontype__"
    return type(name, (), {**found, mark: full, "__module__": f"{package}.{kind}"})
