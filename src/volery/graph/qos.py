"""Provides quality-of-service profiles, with the names of rclpy's `qos` module."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from volery.core.errors import GraphError

DEFAULT_DEPTH = 10
MOST_DEPTH = 100_000


def check_depth(depth: int) -> None:
    """Raises `GraphError` if a depth is out of range."""
    if not 1 <= depth <= MOST_DEPTH:
        raise GraphError(f"queue depth must be 1 to {MOST_DEPTH}, not {depth}")


class ReliabilityPolicy(StrEnum):
    """What happens when a subscriber is too slow."""

    SYSTEM_DEFAULT = "system_default"
    BEST_EFFORT = "best_effort"
    """The oldest message is dropped, and counted."""
    RELIABLE = "reliable"
    """No message is dropped; the subscription of a client that never catches up ends with a
    reason."""


class DurabilityPolicy(StrEnum):
    """Which messages late subscribers receive."""

    SYSTEM_DEFAULT = "system_default"
    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"
    """The publisher's last message."""


class HistoryPolicy(StrEnum):
    """How many messages are queued."""

    KEEP_LAST = "keep_last"
    KEEP_ALL = "keep_all"
    """As many as possible; the depth has no effect."""
    SYSTEM_DEFAULT = "system_default"


@dataclass
class QoSProfile:
    """Quality of service of a publisher or subscription.

    Inside the simulation no message is delayed or lost; depth and reliability of a subscription
    have an effect only through a bridge. Durability has an effect for publishers only: every
    subscription receives latched messages. rclpy's `deadline`, `lifespan` and `liveliness` have no
    effect.
    """

    depth: int = DEFAULT_DEPTH
    """Maximum number of queued messages with best effort."""
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
        """Whether no message may be dropped."""
        return self.reliability == ReliabilityPolicy.RELIABLE

    @property
    def latched(self) -> bool:
        """Whether later subscribers receive a publisher's last message."""
        return self.durability == DurabilityPolicy.TRANSIENT_LOCAL


DEFAULT_QOS = QoSProfile()

qos_profile_sensor_data = QoSProfile(depth=5)
"""rclpy's profile for sensors: best effort, the newest five."""


def profile_of(qos: int | QoSProfile) -> QoSProfile:
    """Returns a profile, or the profile of a depth. Raises `GraphError` for a wrong depth."""
    if not isinstance(qos, QoSProfile):
        return QoSProfile(qos)
    check_depth(qos.depth)
    return qos
