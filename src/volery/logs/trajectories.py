"""Finds the UAVs of a log and reads their trajectories from topics with poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from volery.core.arrays import Array
from volery.core.errors import VoleryError
from volery.core.plurals import counted
from volery.logs.topic_count import TopicCount
from volery.logs.topic_data import TopicData

_POSES = {
    "nav_msgs/msg/Odometry": "pose.pose",
    "geometry_msgs/msg/PoseStamped": "pose",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose",
}
"""Fields with the pose, by type."""
_PREFERRED = (
    "ground_truth/odom",
    "slam/pose",
    "slam/odom",
    "odom",
    "local_position/pose",
    "mavros/local_position/pose",
)
"""Topics of a UAV's pose, in order of preference; any other topic with poses comes after them."""
_COMMANDS = ("goal", "setpoint", "target", "waypoint", "command")
"""Words in names of pose topics that are commands."""
_NO_UAVS = ("actors", "volery", "coverage")
"""First parts of Volery's topics with poses that are no UAVs."""


@dataclass(frozen=True, eq=False)
class LoggedTrajectory:
    """The poses of one UAV in a log, n samples, in the order of the log; finite ones only."""

    uav: str
    """Name of the UAV."""
    topic: str
    """Topic of the poses."""
    times_s: Array
    """(n,) time of the log, s."""
    position: Array
    """(n, 3) m, in the frame of the topic's messages."""
    attitude: Array
    """(n, 4) quaternions x y z w, that frame from body."""

    def __repr__(self) -> str:
        samples = counted(len(self.times_s), "sample")
        return f"LoggedTrajectory({self.uav!r}, {self.topic!r}: {samples})"


def pose_topics(topics: Mapping[str, TopicCount]) -> dict[str, str]:
    """Returns the topic with the preferred poses of each UAV, by name.

    UAVs are the namespaces of topics with poses. A log without any has its only pose topics under
    their own names.
    """
    found: dict[str, str] = {}
    for topic, count in sorted(topics.items()):
        if count.msgtype not in _POSES or not count.messages:
            continue
        name, slash, rest = topic[1:].partition("/")
        if name in _NO_UAVS or any(word in topic.lower() for word in _COMMANDS):
            continue
        uav = name if slash else topic
        best = found.get(uav)
        if best is None or _rank(rest) < _rank(best[1:].partition("/")[2]):
            found[uav] = topic
    return dict(sorted(found.items(), key=lambda pair: natural(pair[0])))


def natural(name: str) -> tuple[int, str]:
    """Returns a key that sorts uav2 before uav10."""
    return len(name), name


def read_trajectory(uav: str, data: TopicData) -> LoggedTrajectory:
    """Returns the poses of a topic; leaves out those that are not finite.

    Raises `VoleryError` for a topic without poses.
    """
    field = _POSES.get(data.msgtype)
    if field is None:
        types = ", ".join(_POSES)
        raise VoleryError(f"{data.topic} holds no poses: its type is {data.msgtype}, not {types}")
    columns = data.columns(f"{field}.position", f"{field}.orientation")
    position, attitude = columns.values()
    finite = np.isfinite(position).all(axis=1) & np.isfinite(attitude).all(axis=1)
    return LoggedTrajectory(
        uav, data.topic, data.times_s[finite], position[finite], attitude[finite]
    )


def _rank(rest: str) -> int:
    return _PREFERRED.index(rest) if rest in _PREFERRED else len(_PREFERRED)
