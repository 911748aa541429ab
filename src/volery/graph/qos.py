"""How messages wait for those who are slow, in the words of rclpy's `qos` module."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from volery.core.errors import GraphError

DEFAULT_DEPTH = 10
MOST_DEPTH = 100_000


def check_depth(depth: int) -> None:
    """`GraphError` for a depth that cannot be."""
    if not 1 <= depth <= MOST_DEPTH:
        raise GraphError(f"queue depth must be 1 to {MOST_DEPTH}, not {depth}")


class ReliabilityPolicy(StrEnum):
    """What happens where a subscriber is too slow."""

    BEST_EFFORT = "best_effort"
    """The oldest message goes, and is counted."""
    RELIABLE = "reliable"
    """Nothing goes; a subscription that falls behind without end is ended, and told why."""


class DurabilityPolicy(StrEnum):
    """What those get who subscribe late."""

    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"
    """The publisher's last message."""


@dataclass(frozen=True)
class QoSProfile:
    """Quality of service of a publisher or subscription.

    Inside the simulation nothing ever waits or is lost; the depth and reliability of a subscription
    count where it goes through a door. Durability counts for publishers alone: every subscription
    gets what is latched.
    """

    depth: int = DEFAULT_DEPTH
    """Messages that wait at most with best effort."""
    reliability: ReliabilityPolicy = ReliabilityPolicy.BEST_EFFORT
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE

    def __post_init__(self) -> None:
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
    return qos if isinstance(qos, QoSProfile) else QoSProfile(qos)
