"""Scans of a level and a nodding scanner among posts on a slope, cast by formula."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from volery.graph import messages as m
from volery.graph.codecs.zero import zero_message

HEIGHT_M = 3.0
MIDDLE = (1080 / 2) * math.radians(0.25)


class Post(NamedTuple):
    """An upright cylinder."""

    x: float
    y: float
    radius: float
    low: float
    high: float


TRUNK = Post(6.0, 2.0, 0.15, -1.0, 20.0)
CROWN = Post(7.0, -2.0, 0.25, 2.9, 4.5)
POSTS = (TRUNK, CROWN)


def slope(x: Any) -> Any:
    """Height of the ground."""
    return 0.12 * x


def seen_from(position: np.ndarray, nod: float) -> np.ndarray:
    """Ranges (1081,) of a scanner there that looks along x, by `nod` down."""
    angle = math.radians(0.25) * np.arange(1081) - MIDDLE
    along = np.stack([np.cos(nod) * np.cos(angle), np.sin(angle), -np.sin(nod) * np.cos(angle)], 1)
    with np.errstate(divide="ignore"):
        ground = (slope(position[0]) - position[2]) / (along[:, 2] - 0.12 * along[:, 0])
    ranges = np.where(ground > 0.0, ground, np.inf)
    level = np.hypot(along[:, 0], along[:, 1])
    for post in POSTS:
        to = np.array([post.x, post.y]) - position[:2]
        near = (along[:, :2] @ to) / level
        aside = np.abs(along[:, 0] * to[1] - along[:, 1] * to[0]) / level
        at = (near - np.sqrt(np.maximum(post.radius**2 - aside**2, 0.0))) / level
        z = position[2] + at * along[:, 2]
        hit = (near > 0.0) & (aside < post.radius) & (post.low < z) & (z < post.high)
        ranges[hit] = np.minimum(ranges[hit], at[hit])
    ranges[ranges > 30.0] = np.inf
    return ranges


def scan_message(frame: str, time_ns: int, ranges: np.ndarray) -> Any:
    scan = zero_message("sensor_msgs/msg/LaserScan")
    scan.header = m.header(time_ns, frame)
    scan.angle_min, scan.angle_increment = -MIDDLE, math.radians(0.25)
    scan.ranges = ranges.astype(np.float32)
    return scan


def nods_message(time_ns: int, angle: float) -> Any:
    joint = zero_message("sensor_msgs/msg/JointState")
    joint.header = m.header(time_ns, "")
    joint.name, joint.position = ["laser_nodding"], np.array([angle])
    return joint
