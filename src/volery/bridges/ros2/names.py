"""Names of ROS 2 and what middlewares call the same things.

https://design.ros2.org/articles/topic_and_service_names.html tells what is allowed, and what DDS
calls topics and services; types are called `pkg::msg::dds_::Name_` by rosidl's type supports.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from volery.core.errors import GraphError

MOST_CHARS = 247
"""Of a name: RMW_TOPIC_MAX_NAME_LENGTH of rmw/validate_full_topic_name.h."""

_NAME = re.compile(r"(?:/[A-Za-z_][A-Za-z0-9_]*)+", re.ASCII)
_DDS_TYPE = re.compile(r"(\w+)::(msg|srv|action)::dds_::(\w+)_", re.ASCII)


class NodeName(NamedTuple):
    """A node: `/uav1` and `gap_following`."""

    namespace: str
    """With its slash; `/` for the root."""
    name: str

    @property
    def full(self) -> str:
        """Both in one: `/uav1/gap_following`."""
        return f"{self.namespace.rstrip('/')}/{self.name}"

    @classmethod
    def of(cls, full: str) -> NodeName:
        """From a full name."""
        namespace, _, name = full.rpartition("/")
        return cls(namespace or "/", name)


def check_name(name: str) -> None:
    """`GraphError` for a name of a topic, service or node that ROS 2 does not allow."""
    if _NAME.fullmatch(name) is None:
        raise GraphError(
            f"ROS 2 does not allow the name '{name}': parts between slashes are made of ASCII "
            "letters, digits and _, and none begins with a digit"
        )
    if len(name) > MOST_CHARS:
        raise GraphError(f"ROS 2 does not allow names of more than {MOST_CHARS} letters: '{name}'")


def dds_topic(topic: str) -> str:
    """What a topic is called in DDS: `rt/chatter`."""
    return f"rt{topic}"


def dds_request_topic(service: str) -> str:
    """Where a service's requests go in DDS: `rq/uav1/landRequest`."""
    return f"rq{service}Request"


def dds_reply_topic(service: str) -> str:
    """Where a service's replies go in DDS: `rr/uav1/landReply`."""
    return f"rr{service}Reply"


def topic_of(dds_name: str) -> str | None:
    """Topic of a name in DDS; None where it is none of ROS 2."""
    return dds_name[2:] if dds_name.startswith("rt/") else None


def service_of(dds_name: str) -> str | None:
    """Service whose requests go to a name in DDS; None where it is none."""
    found = dds_name.startswith("rq/") and dds_name.endswith("Request")
    return dds_name[2 : -len("Request")] if found else None


def dds_type(msgtype: str) -> str:
    """`std_msgs::msg::dds_::String_` of `std_msgs/msg/String`."""
    package, kind, name = msgtype.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def ros_type(dds_name: str) -> str | None:
    """`std_msgs/msg/String` of `std_msgs::msg::dds_::String_`; None for a type not of ROS 2."""
    match = _DDS_TYPE.fullmatch(dds_name)
    return None if match is None else "/".join(match.groups())
