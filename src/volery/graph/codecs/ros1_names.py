"""Converts type names between ROS 1 and ROS 2."""

from __future__ import annotations

import re
from typing import Literal

from volery.core.errors import GraphError

_PACKAGES = {"rosapi_msgs": "rosapi"}
"""Packages whose interfaces moved to another package in ROS 2."""
_OLD_PACKAGES = {old: new for new, old in _PACKAGES.items()}
_TYPES = {
    "builtin_interfaces/msg/Time": "std_msgs/Time",
    "builtin_interfaces/msg/Duration": "std_msgs/Duration",
}
"""Basic types of ROS 1, and their message types with nothing but that field."""
_OLD_TYPES = {
    **{old: new for new, old in _TYPES.items()},
    **{old.replace("/", "/msg/"): new for new, old in _TYPES.items()},
    "tf/tfMessage": "tf2_msgs/msg/TFMessage",
    "tf/msg/tfMessage": "tf2_msgs/msg/TFMessage",
    "roslib/Header": "std_msgs/msg/Header",
}
_NAME = re.compile(r"([A-Za-z]\w*)/(?:(msg|srv|action)/)?([A-Za-z]\w*)", re.ASCII)
_PART = re.compile(r"(.+)_(Request|Response|Goal|Result|Feedback)")


def ros1_name(msgtype: str) -> str:
    """Returns the ROS 1 name of a type: `std_msgs/msg/String` becomes `std_msgs/String`.

    Parts of a service lose their underscore: `std_srvs/srv/SetBool_Request` becomes
    `std_srvs/SetBoolRequest`. A name in ROS 1 form is returned unchanged. Raises `GraphError` if
    the text is not the name of a type.
    """
    if msgtype in _TYPES:
        return _TYPES[msgtype]
    package, kind, name = _split(msgtype)
    if kind in ("srv", "action"):
        part = _PART.fullmatch(name)
        name = part[1] + part[2] if part else name
    return f"{_PACKAGES.get(package, package)}/{name}"


def ros2_name(name: str, kind: Literal["msg", "srv", "action"] = "msg") -> str:
    """Returns the ROS 2 name of a type given in either spelling.

    name: `std_msgs/String` or `std_msgs/msg/String`, with more slashes as rosbridge accepts them.
    kind: the kind of a name with two parts. Raises `GraphError` if the text is not the name of a
    type, or names another kind.
    """
    if isinstance(name, str):
        name = re.sub("/+", "/", name).removeprefix("/")
    if name in _OLD_TYPES:
        return _OLD_TYPES[name]
    package, given, base = _split(name)
    if given and given != kind:
        raise GraphError(f"'{name}' names a {given}, not a {kind}")
    return f"{_OLD_PACKAGES.get(package, package)}/{kind}/{base}"


def _split(name: str) -> tuple[str, str | None, str]:
    match = _NAME.fullmatch(name) if isinstance(name, str) else None
    if match is None:
        raise GraphError(f"{name!r} is not the name of a ROS type, such as 'std_msgs/String'")
    return match[1], match[2], match[3]
