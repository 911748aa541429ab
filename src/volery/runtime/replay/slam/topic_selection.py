"""Selects the topics of a log that the SLAM subscribes to."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from volery.core.errors import RecordingError

SCAN, ODOMETRY, IMU = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "sensor_msgs/msg/Imu"
LEVEL, NODDING = "laser/horizontal/scan", "laser/nodding/scan"
_NOT_SENSED = ("ground_truth/odom", "slam/odom")


@dataclass(frozen=True)
class RequestedTopics:
    """Topics requested by the user; None: those with the usual names, or the only ones."""

    uav: str | None = None
    scan: str | None = None
    odometry: str | None = None
    imu: str | None = None
    has_odometry: bool = True
    has_imu: bool | None = None
    """None: whether the log has an IMU and a nodding LIDAR."""


@dataclass(frozen=True)
class TopicSelection:
    """Selected topics; `names` maps the node's topics to those of the log."""

    uav: str
    names: dict[str, str]
    has_imu: bool

    @property
    def scan(self) -> str:
        """Topic of the horizontal LIDAR in the log."""
        return self.names[f"/{self.uav}/{LEVEL}"]


def choose(path: Path, topics: dict[str, str], requested: RequestedTopics) -> TopicSelection:
    """Selects among a log's topics, types by topic. Raises `RecordingError` if ambiguous."""
    _check_uav(path, topics, requested)
    scan = _one(path, topics, SCAN, requested.scan, requested.uav, LEVEL)
    assert scan is not None
    uav = requested.uav or (scan.split("/")[1] if scan.endswith(f"/{LEVEL}") else "") or "uav1"
    names = {f"/{uav}/{LEVEL}": scan, "/tf_static": "/tf_static"}
    imu = _one(path, topics, IMU, requested.imu, uav, "imu", needed=bool(requested.has_imu))
    nodding = f"/{uav}/{NODDING}"
    uses_imu = requested.has_imu
    if uses_imu is None:
        uses_imu = imu is not None and nodding in topics
    if uses_imu and imu is not None:
        own = {f"/{uav}/{t}": f"/{uav}/{t}" for t in (NODDING, "joint_states", "range")}
        names |= {f"/{uav}/imu": imu, **{k: v for k, v in own.items() if v in topics}}
    elif requested.has_odometry:
        needed = requested.odometry is not None
        odometry = _one(path, topics, ODOMETRY, requested.odometry, uav, "odom", needed=needed)
        if odometry is not None:
            names[f"/{uav}/odom"] = odometry
    return TopicSelection(uav, names, bool(uses_imu))


def other_uavs(topics: dict[str, str], uav: str) -> list[str]:
    """Returns the UAVs of a log, except `uav`, that have a horizontal LIDAR."""
    return sorted({t.split("/")[1] for t in topics if t.endswith(f"/{LEVEL}")} - {"", uav})


def _check_uav(path: Path, topics: dict[str, str], requested: RequestedTopics) -> None:
    """Raises `RecordingError` if the log has no topic of the requested UAV."""
    uav = requested.uav
    if uav is None or requested.scan is not None or any(t.startswith(f"/{uav}/") for t in topics):
        return
    known = _list(other_uavs(topics, uav))
    raise RecordingError(f"{path}: there is no {uav} in it; there is {known}")


def _one(
    path: Path,
    topics: dict[str, str],
    kind: str,
    name: str | None,
    uav: str | None,
    usual: str,
    *,
    needed: bool = True,
) -> str | None:
    """Returns the topic of a type: the requested, the usual or the only one."""
    known = sorted(t for t, what in topics.items() if what == kind and not t.endswith(_NOT_SENSED))
    if name is not None:
        if name in known:
            return name
        raise RecordingError(f"{path}: there is no {kind} on {name}; there is {_list(known)}")
    fitting = [t for t in known if t == f"/{uav}/{usual}"] or [
        t for t in known if uav is None and t.endswith(f"/{usual}")
    ]
    if not fitting and (uav is None or kind != SCAN):
        fitting = known
    if len(fitting) == 1 or (fitting and fitting[0].endswith(usual)):
        return fitting[0]
    if needed:
        raise RecordingError(f"{path}: which {kind} is meant? There is {_list(known)}")
    return None


def _list(names: list[str]) -> str:
    return ", ".join(names) or "none"
