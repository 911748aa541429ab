"""Provides quality-of-service profiles, with the names of rclpy's `qos` module."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from volery.core.errors import GraphError

DEFAULT_DEPTH = 10
MAX_DEPTH = 100_000


def check_depth(depth: int) -> None:
    """Raises `GraphError` if a depth is out of range."""
    if not 1 <= depth <= MAX_DEPTH:
        raise GraphError(f"queue depth must be 1 to {MAX_DEPTH}, not {depth}")


class _Policy(StrEnum):
    """Policy of rclpy, which a program may also name by its number or by its old name."""

    @classmethod
    def _missing_(cls, value: object) -> _Policy | None:
        numbers = _NUMBERS[cls.__name__]
        known = isinstance(value, int) and value in numbers
        return cls[numbers[value]] if known else None  # type: ignore[index]

    @property
    def short_key(self) -> str:
        """Name in lower case."""
        return self.name.lower()

    @classmethod
    def short_keys(cls) -> list[str]:
        """Returns the names in lower case."""
        return [policy.short_key for policy in cls]

    @classmethod
    def get_from_short_key(cls, name: str) -> _Policy:
        """Returns the policy of a name, whatever its case."""
        return cls[name.upper()]


_NUMBERS = {
    "ReliabilityPolicy": {
        0: "SYSTEM_DEFAULT",
        1: "RELIABLE",
        2: "BEST_EFFORT",
        3: "UNKNOWN",
        4: "BEST_AVAILABLE",
    },
    "DurabilityPolicy": {
        0: "SYSTEM_DEFAULT",
        1: "TRANSIENT_LOCAL",
        2: "VOLATILE",
        3: "UNKNOWN",
        4: "BEST_AVAILABLE",
    },
    "HistoryPolicy": {0: "SYSTEM_DEFAULT", 1: "KEEP_LAST", 2: "KEEP_ALL", 3: "UNKNOWN"},
    "LivelinessPolicy": {
        0: "SYSTEM_DEFAULT",
        1: "AUTOMATIC",
        3: "MANUAL_BY_TOPIC",
        4: "UNKNOWN",
        5: "BEST_AVAILABLE",
    },
}
"""Numbers of the policies in `rmw/types.h`."""


class ReliabilityPolicy(_Policy):
    """What happens when a subscriber is too slow."""

    SYSTEM_DEFAULT = "system_default"
    BEST_EFFORT = "best_effort"
    """The oldest message is dropped, and counted."""
    RELIABLE = "reliable"
    """No message is dropped; the subscription of a client that never catches up ends with a
    reason."""
    UNKNOWN = "unknown"
    BEST_AVAILABLE = "best_available"
    RMW_QOS_POLICY_RELIABILITY_SYSTEM_DEFAULT = SYSTEM_DEFAULT
    RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT = BEST_EFFORT
    RMW_QOS_POLICY_RELIABILITY_RELIABLE = RELIABLE
    RMW_QOS_POLICY_RELIABILITY_UNKNOWN = UNKNOWN


class DurabilityPolicy(_Policy):
    """Which messages late subscribers receive."""

    SYSTEM_DEFAULT = "system_default"
    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"
    """The publisher's last message."""
    UNKNOWN = "unknown"
    BEST_AVAILABLE = "best_available"
    RMW_QOS_POLICY_DURABILITY_SYSTEM_DEFAULT = SYSTEM_DEFAULT
    RMW_QOS_POLICY_DURABILITY_VOLATILE = VOLATILE
    RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL = TRANSIENT_LOCAL
    RMW_QOS_POLICY_DURABILITY_UNKNOWN = UNKNOWN


class HistoryPolicy(_Policy):
    """How many messages are queued."""

    KEEP_LAST = "keep_last"
    KEEP_ALL = "keep_all"
    """As many as possible; the depth has no effect."""
    SYSTEM_DEFAULT = "system_default"
    UNKNOWN = "unknown"
    RMW_QOS_POLICY_HISTORY_KEEP_LAST = KEEP_LAST
    RMW_QOS_POLICY_HISTORY_KEEP_ALL = KEEP_ALL
    RMW_QOS_POLICY_HISTORY_SYSTEM_DEFAULT = SYSTEM_DEFAULT
    RMW_QOS_POLICY_HISTORY_UNKNOWN = UNKNOWN


class LivelinessPolicy(_Policy):
    """Has no effect."""

    AUTOMATIC = "automatic"
    MANUAL_BY_TOPIC = "manual_by_topic"
    SYSTEM_DEFAULT = "system_default"
    UNKNOWN = "unknown"
    BEST_AVAILABLE = "best_available"
    RMW_QOS_POLICY_LIVELINESS_AUTOMATIC = AUTOMATIC
    RMW_QOS_POLICY_LIVELINESS_MANUAL_BY_TOPIC = MANUAL_BY_TOPIC
    RMW_QOS_POLICY_LIVELINESS_SYSTEM_DEFAULT = SYSTEM_DEFAULT


@dataclass
class QoSProfile:
    """Quality of service of a publisher or subscription.

    Inside the simulation no message is delayed or lost; depth and reliability of a subscription
    have an effect only through a bridge. Durability has an effect for publishers only: every
    subscription receives latched messages. rclpy's `deadline`, `lifespan` and `liveliness` have no
    effect.
    """

    depth: int = DEFAULT_DEPTH
    """Maximum number of queued messages with best effort; 0: the default, as in rclpy."""
    reliability: ReliabilityPolicy = ReliabilityPolicy.BEST_EFFORT
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE
    history: HistoryPolicy = HistoryPolicy.KEEP_LAST
    deadline: Any = None
    lifespan: Any = None
    liveliness: Any = None
    liveliness_lease_duration: Any = None
    avoid_ros_namespace_conventions: bool = False

    def __post_init__(self) -> None:
        self.reliability = ReliabilityPolicy(self.reliability)
        self.durability = DurabilityPolicy(self.durability)
        self.history = HistoryPolicy(self.history)
        if self.history == HistoryPolicy.KEEP_ALL:
            self.depth = MAX_DEPTH
        self.depth = self.depth or DEFAULT_DEPTH
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
