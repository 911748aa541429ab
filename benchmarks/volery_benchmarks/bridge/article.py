"""Holds published latencies: the ROS + Unity3D platform, and Unity's ROS-TCP-Endpoint.

The platform's are those of its article of 2025: ROS and Unity3D joined by ROS-TCP-Connector and
ROS-TCP-Endpoint, commands of ten trials of ten, on a desktop and on a laptop. Of its first table
only the fitted line is available, not the single sizes; of its machines, the names.

Those of ROS-TCP-Endpoint 0.7.0 were measured by us: rospy 1.15.15 publishes `sensor_msgs/Image` to
a plain client, from the publisher's stamp to the client; Debian 12, Python 3.11, two cores.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Line:
    """Line L = alpha S + beta: latency over the size of a message, in s/MB and s."""

    alpha_s_per_mb: float
    beta_s: float

    def latency_ms(self, size_bytes: float) -> float:
        """Returns the latency of a message of that size, ms."""
        return 1e3 * (self.alpha_s_per_mb * size_bytes / 1e6 + self.beta_s)


@dataclass(frozen=True)
class EndPoints:
    """Mean latencies of a command on one machine, ms; None: not available."""

    machine: str
    round_trip: float | None
    one_way: float | None
    stop: float | None


ARTICLE_LINE = Line(0.035, 0.005)
ARTICLE = (
    EndPoints("the article's desktop", 6.65, 3.32, 2.26),
    EndPoints("the article's laptop", 201.0, 92.6, 409.0),
)


@dataclass(frozen=True)
class Reference:
    """Describes a bridge that was measured once; see the module's docstring."""

    name: str
    line: Line
    medians_ms: Mapping[int, float] = field(default_factory=dict)
    """Median latency, ms, by size in bytes."""
    round_trip_ms: float | None = None


UNITY_ENDPOINT = Reference(
    "ROS-TCP-Endpoint 0.7.0",
    Line(0.0043, 0.0005),
    {0: 0.85, 100_000: 1.13, 1_000_000: 3.55, 2_500_000: 10.6},
    round_trip_ms=0.86,
)
