"""Ways and trunk maps of the UAVs in a log, of a simulated flight or a real one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.records import LogWalk
from volery.core.errors import GraphError, VoleryError
from volery.graph.messages import stamp_of
from volery.report.trunks import TrunkMap, in_map, trunks_of_scan
from volery.report.ways import Way

Array = NDArray[np.float64]

TRUTH = "ground_truth/odom"
ESTIMATES = ("slam/pose", "slam/odom", "odom")
"""Where a UAV's own idea of its pose is looked for, the first that there is."""
SCAN = "laser/horizontal/scan"
_POSE_TYPES = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
)
_SCAN_NS, _POSE_NS = 500_000_000, 50_000_000
_SEEN_OFTEN = 3


@dataclass(frozen=True)
class LoggedUav:
    """What a log tells of one UAV."""

    name: str
    truth: Way | None
    estimate: Way | None
    trunks: Array
    """(T, 2) m, where the estimate puts them; of those seen three times."""


@dataclass
class _Rows:
    poses: list[tuple[float, ...]] = field(default_factory=list)
    next_ns: int = 0

    def take(self, message: Any, time_ns: int) -> None:
        """Keep a pose, twenty a second."""
        if time_ns < self.next_ns:
            return
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        p, q = pose.position, pose.orientation
        numbers = (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
        if all(map(math.isfinite, numbers)):  # filters that are lost tell NaN
            self.next_ns = time_ns + _POSE_NS
            self.poses.append((time_ns * 1e-9, *numbers))

    def way(self) -> Way:
        """All of them."""
        return Way.of_rows(self.poses)


def read_uavs(path: Path) -> list[LoggedUav]:
    """The UAVs of a log by the topics that Volery gives them, by name.

    `RecordingError` where the file is no log, `VoleryError` where there is no UAV in it.
    """
    ways, scans = _read(path)
    names = {topic.split("/")[1] for topic in ways if topic.count("/") > 1}
    found = []
    for name in sorted(names):
        truth = ways.get(f"/{name}/{TRUTH}")
        own = next((f"/{name}/{t}" for t in ESTIMATES if f"/{name}/{t}" in ways), None)
        if truth is None and own is None:
            continue
        estimate = None if own is None else ways[own].way()
        seen = scans.get(f"/{name}/{SCAN}", [])
        trunks = np.zeros((0, 2)) if estimate is None else _map_of(estimate, seen)
        found.append(LoggedUav(name, None if truth is None else truth.way(), estimate, trunks))
    if not found:
        raise VoleryError(f"{path}: no UAV tells its pose in it (/NAME/{ESTIMATES[-1]})")
    return found


def read_way(path: Path, topic: str | None = None) -> Way:
    """One way of a log: that of `topic`, or of the only topic that there is to choose.

    `VoleryError` names the topics where that cannot be said.
    """
    ways, _ = _read(path)
    known = [name for name, rows in ways.items() if not name.endswith(TRUTH) and rows.poses]
    if topic is None and len(known) == 1:
        return ways[known[0]].way()
    if topic is None or topic not in ways:
        what = "which way is meant" if topic is None else f"there is no {topic}"
        raise VoleryError(
            f"{path}: {what}? Poses stand on: {', '.join(sorted(known)) or 'nothing'}"
        )
    return ways[topic].way()


def _read(path: Path) -> tuple[dict[str, _Rows], dict[str, list[tuple[float, Array]]]]:
    decoder = LogDecoder()
    ways: dict[str, _Rows] = {}
    scans: dict[str, list[tuple[float, Array]]] = {}
    due: dict[str, int] = {}
    for record in LogWalk(path):
        topic = record.topic.topic
        is_scan = topic.endswith(SCAN)
        if is_scan and record.time_ns < due.get(topic, 0):
            continue
        try:
            kind = decoder.type_of(record.topic)
            if kind not in _POSE_TYPES and not (is_scan and kind == "sensor_msgs/msg/LaserScan"):
                continue
            message = decoder.decode(record).message
        except GraphError:
            continue  # of a type that is not known here
        stamp = stamp_of(message) or record.time_ns
        if is_scan:
            due[topic] = record.time_ns + _SCAN_NS
            trunks = trunks_of_scan(message.ranges, message.angle_min, message.angle_increment)
            scans.setdefault(topic, []).append((stamp * 1e-9, trunks))
        else:
            ways.setdefault(topic, _Rows()).take(message, stamp)
    return ways, scans


def _map_of(way: Way, scans: Sequence[tuple[float, Array]]) -> Array:
    trunks = TrunkMap()
    for seconds, seen in scans:
        pose = way.pose_at(seconds)
        if pose is not None:
            trunks.add(in_map(seen, *pose))
    return trunks.places[trunks.sightings >= _SEEN_OFTEN]
