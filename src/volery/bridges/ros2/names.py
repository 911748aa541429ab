"""Names of ROS 2 and their forms in middlewares.

https://design.ros2.org/articles/topic_and_service_names.html defines the allowed names, and the
names of topics and services in DDS; types are named `pkg::msg::dds_::Name_` by rosidl's type
supports.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from volery.core.errors import GraphError

MAX_CHARS = 247
"""Longest name: RMW_TOPIC_MAX_NAME_LENGTH of rmw/validate_full_topic_name.h."""

_NAME = re.compile(r"(?:/[A-Za-z_][A-Za-z0-9_]*)+", re.ASCII)
_DDS_TYPE = re.compile(r"(\w+)::(msg|srv|action)::dds_::(\w+)_", re.ASCII)


class NodeName(NamedTuple):
    """A node: `/uav1` and `gap_following`."""

    namespace: str
    """With a leading slash; `/` for the root."""
    name: str

    @property
    def full(self) -> str:
        """Full name: `/uav1/gap_following`."""
        return f"{self.namespace.rstrip('/')}/{self.name}"

    @classmethod
    def of(cls, full: str) -> NodeName:
        """Returns the node of a full name."""
        namespace, _, name = full.rpartition("/")
        return cls(namespace or "/", name)


def check_name(name: str) -> None:
    """Raises `GraphError` for a name of a topic, service or node that ROS 2 does not allow."""
    if _NAME.fullmatch(name) is None:
        raise GraphError(
            f"ROS 2 does not allow the name '{name}': use ASCII "
            "letters, digits and _ between slashes, no part beginning with a digit"
        )
    if len(name) > MAX_CHARS:
        raise GraphError(
            f"ROS 2 does not allow names of more than {MAX_CHARS} characters: '{name}'"
        )


def dds_topic(topic: str) -> str:
    """Returns the DDS name of a topic: `rt/chatter`."""
    return f"rt{topic}"


def dds_request_topic(service: str) -> str:
    """Returns the DDS topic of a service's requests: `rq/uav1/landRequest`."""
    return f"rq{service}Request"


def dds_reply_topic(service: str) -> str:
    """Returns the DDS topic of a service's replies: `rr/uav1/landReply`."""
    return f"rr{service}Reply"


def topic_of(dds_name: str) -> str | None:
    """Returns the topic of a DDS name; None if it is not one of ROS 2."""
    return dds_name[2:] if dds_name.startswith("rt/") else None


def service_of(dds_name: str) -> str | None:
    """Returns the service of a DDS request topic; None if it is not one."""
    found = dds_name.startswith("rq/") and dds_name.endswith("Request")
    return dds_name[2 : -len("Request")] if found else None


def dds_type(msgtype: str) -> str:
    """Returns `std_msgs::msg::dds_::String_` for `std_msgs/msg/String`."""
    package, kind, name = msgtype.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type(dds_name: str) -> str | None:
    """Returns `std_msgs/msg/String` for `std_msgs::msg::dds_::String_`.

    None for types not of ROS 2.
    """
    match = _DDS_TYPE.fullmatch(dds_name)
    return None if match is None else "/".join(match.groups())
