"""How messages wait for those who are slow, in the words of rclpy's `qos` module."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from volery.core.errors import GraphError

DEFAULT_DEPTH = 10
MOST_DEPTH = 100_000


def check_depth(depth: int) -> None:
    """`GraphError` for a depth that cannot be."""
    if not 1 <= depth <= MOST_DEPTH:
        raise GraphError(f"queue depth must be 1 to {MOST_DEPTH}, not {depth}")


class ReliabilityPolicy(StrEnum):
    """What happens where a subscriber is too slow."""

    SYSTEM_DEFAULT = "system_default"
    BEST_EFFORT = "best_effort"
    """The oldest message goes, and is counted."""
    RELIABLE = "reliable"
    """Nothing goes; a subscription that falls behind without end is ended, and told why."""


class DurabilityPolicy(StrEnum):
    """What those get who subscribe late."""

    SYSTEM_DEFAULT = "system_default"
    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"
    """The publisher's last message."""


class HistoryPolicy(StrEnum):
    """How many messages wait."""

    KEEP_LAST = "keep_last"
    KEEP_ALL = "keep_all"
    """As many as may wait at all; the depth does not count."""
    SYSTEM_DEFAULT = "system_default"


@dataclass
class QoSProfile:
    """Quality of service of a publisher or subscription.

    Inside the simulation nothing ever waits or is lost; the depth and reliability of a subscription
    count where it goes through a bridge. Durability counts for publishers alone: every subscription
    gets what is latched. rclpy's `deadline`, `lifespan` and `liveliness` are without effect.
    """

    depth: int = DEFAULT_DEPTH
    """Messages that wait at most with best effort."""
    reliability: ReliabilityPolicy = ReliabilityPolicy.BEST_EFFORT
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE
    history: HistoryPolicy = HistoryPolicy.KEEP_LAST
    deadline: Any = None
    lifespan: Any = None
    liveliness: Any = None
    liveliness_lease_duration: Any = None
    avoid_ros_namespace_conventions: bool = False

    def __post_init__(self) -> None:
        if self.history == HistoryPolicy.KEEP_ALL:
            self.depth = MOST_DEPTH
        check_depth(self.depth)

    @property
    def reliable(self) -> bool:
        """Whether no message may be lost."""
        return self.reliability == ReliabilityPolicy.RELIABLE

    @property
    def latched(self) -> bool:
        """Whether a publisher's last message awaits those who subscribe later."""
        return self.durability == DurabilityPolicy.TRANSIENT_LOCAL


DEFAULT_QOS = QoSProfile()

qos_profile_sensor_data = QoSProfile(depth=5)
"""rclpy's profile for sensors: best effort, the newest five."""


def profile_of(qos: int | QoSProfile) -> QoSProfile:
    """A profile, or that of a depth. `GraphError` for a depth that cannot be."""
    if not isinstance(qos, QoSProfile):
        return QoSProfile(qos)
    check_depth(qos.depth)
    return qos
