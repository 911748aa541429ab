"""A topic of a log: its type and the number of its messages."""

from __future__ import annotations

from typing import NamedTuple


class TopicCount(NamedTuple):
    """A topic of a log: its type and the number of its messages."""

    msgtype: str
    """Name in ROS 2 style, `nav_msgs/msg/Odometry`."""
    messages: int
    """Number of messages."""
