"""Transforms the returns of LIDAR messages to the map, each by the UAV's pose at its time."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.graph.messages import stamp_of
from volery.publishing.lidar_publishing import cloud_points

MAX_RANGE_M = 28.0
"""Longer beams are not mapped, because of heading errors and dropouts."""
_LONGEST_PIECE_NS = 20_000_000


def scan_points(scan: Any, mount: Any, poses: deque[tuple[int, Any]]) -> NDArray[np.float64] | None:
    """Returns map points (n, 3) of a LaserScan or PointCloud2; None without poses.

    Each beam is placed from the body's poses before and after it, which come from `poses` (time in
    ns, geometry_msgs/Pose); the two positions are interpolated.
    """
    start_ns = stamp_of(scan)
    if not poses or poses[0][0] > start_ns:
        return None
    along, fraction = _beams_of_cloud(scan) if _is_cloud(scan) else _beams_of_scan(scan)
    nod = _nodding_angles(mount, start_ns, end_ns(scan), fraction)
    if nod is not None:
        # about the sensor's y axis, positive looks down
        x, y, z = along.T
        along = np.stack(
            [x * np.cos(nod) + z * np.sin(nod), y, z * np.cos(nod) - x * np.sin(nod)], -1
        )
    in_body = along @ rotations.matrix(mount.attitude_body).T + np.asarray(mount.position_body)
    return _in_map(in_body, fraction, [_pose_at(poses, time) for time in _knots(start_ns, scan)])


def _knots(start_ns: int, scan: Any) -> list[int]:
    """Returns times of a sweep between which a body's rotation, below 0.1 rad, is linear."""
    duration = end_ns(scan) - start_ns
    pieces = max(1, -(-duration // _LONGEST_PIECE_NS))
    return [start_ns + duration * k // pieces for k in range(pieces + 1)]


def _in_map(in_body: Array, fraction: Array, ends: list[tuple[Array, Array]]) -> Array:
    """Transforms points (n, 3) from body to map, between the two poses around their time."""
    pieces = len(ends) - 1
    piece = np.minimum((fraction * pieces).astype(np.int64), pieces - 1)
    in_piece = (fraction * pieces - piece)[:, None]
    points = np.empty_like(in_body)
    for k in range(pieces):
        rows = piece == k
        first, last = (p + in_body[rows] @ rotations.matrix(q).T for p, q in ends[k : k + 2])
        points[rows] = first + in_piece[rows] * (last - first)
    return points


def _beams_of_scan(scan: Any) -> tuple[Array, Array]:
    """Returns points (n, 3) of a LaserScan in the sensor frame, and fractions of the sweep (n,)."""
    ranges = np.asarray(scan.ranges, dtype=np.float64)
    beams = np.flatnonzero(
        (ranges >= scan.range_min) & (ranges <= min(scan.range_max, MAX_RANGE_M))
    )
    azimuth = scan.angle_min + scan.angle_increment * beams
    ranges_hit = ranges[beams]
    along = np.stack(
        [ranges_hit * np.cos(azimuth), ranges_hit * np.sin(azimuth), np.zeros(len(beams))], -1
    )
    return along, beams / max(len(ranges) - 1, 1)


def _beams_of_cloud(cloud: Any) -> tuple[Array, Array]:
    """Returns points (n, 3) of a PointCloud2, sensor frame, and fractions of the sweep (n,)."""
    points = cloud_points(cloud)
    along = np.stack([points[name].astype(np.float64) for name in ("x", "y", "z")], -1)
    near = np.linalg.norm(along, axis=1) <= MAX_RANGE_M
    time = points["time"].astype(np.float64)
    return along[near], time[near] / max(time.max(initial=0.0), 1e-9)


def _nodding_angles(mount: Any, first_ns: int, last_ns: int, fraction: Array) -> Array | None:
    if not mount.nods:
        return None
    from volery.sensors.mount import nodding_angle_at

    knots = np.linspace(0.0, 1.0, 5)
    angles = [nodding_angle_at(mount, first_ns + round(k * (last_ns - first_ns))) for k in knots]
    return np.interp(fraction, knots, angles)


def _pose_at(poses: deque[tuple[int, Any]], time_ns: int) -> tuple[Array, Array]:
    """Returns position (3,) and attitude (4,) at a time, clamped to the poses."""
    later = next((k for k, (t, _) in enumerate(poses) if t >= time_ns), len(poses) - 1)
    before = max(later - 1, 0)
    (t0, a), (t1, b) = poses[before], poses[later]
    p0, q0 = _arrays(a)
    p1, q1 = _arrays(b)
    fraction = min(max((time_ns - t0) / (t1 - t0), 0.0), 1.0) if t1 > t0 else 1.0
    q1 = q1 if q0 @ q1 >= 0.0 else -q1
    return p0 + fraction * (p1 - p0), rotations.normalize(q0 + fraction * (q1 - q0))


def _arrays(pose: Any) -> tuple[Array, Array]:
    p, q = pose.position, pose.orientation
    return np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])


def end_ns(scan: Any) -> int:
    """Returns the time of the last beam of a LaserScan or PointCloud2, ns."""
    if _is_cloud(scan):
        sweep_s = float(cloud_points(scan)["time"].max(initial=0.0))
    else:
        sweep_s = float((len(scan.ranges) - 1) * scan.time_increment)
    return stamp_of(scan) + round(sweep_s * NS_PER_S)


def _is_cloud(message: Any) -> bool:
    return hasattr(message, "point_step")
