"""Warmup tasks for the kernels of scans, depth images and the ground.

Nodes list the tasks they need in `warmup_tasks`. A kernel compiles again for each array type, so
the tasks pass the same types as the nodes do: arrays of messages are read-only.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.autonomy.perception.depth_projection import DepthProjector
from volery.autonomy.perception.ground_plane import GroundPlane
from volery.autonomy.perception.motion_history import MotionHistory
from volery.autonomy.perception.scan_points import OdometrySample, ScanProjector
from volery.autonomy.perception.scan_rays import Beams, RayMaker, Rays, has_return
from volery.autonomy.perception.speckle_filter import SpeckleFilter
from volery.autonomy.perception.stuck_sensors import ScanRepeats
from volery.core import rotations
from volery.core.arrays import read_only
from volery.core.clock import NS_PER_S
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import CameraInfo, Image, LaserScan


def scan_returns() -> None:
    """Compiles the kernel that checks whether a scan has returns."""
    has_return(a_scan())


def scan_repeats() -> None:
    """Compiles the kernel that detects repeated scans."""
    repeats = ScanRepeats()
    for _ in range(2):
        repeats.are_reported_by(a_scan())


def scan_rays() -> None:
    """Compiles the kernel that converts scans to rays."""
    some_rays()


def ground() -> None:
    """Compiles the kernels of `ground_plane`."""
    plane = GroundPlane()
    plane.add(np.zeros((1, 3)), 0)
    plane.fit(np.zeros(3), None, 0)


def scan_points() -> None:
    """Compiles the kernel that projects scans to points, after the speckle filter."""
    ScanProjector([0.0, 0.0, 0.0]).points(SpeckleFilter().left_out(a_scan()), a_pose(0))


def depth_points() -> None:
    """Compiles the kernel that projects depth images to points."""
    image, info = zero_message("sensor_msgs/msg/Image"), zero_message("sensor_msgs/msg/CameraInfo")
    image.height = image.width = 1
    image.encoding, image.data = "32FC1", read_only(np.zeros(4, np.uint8))
    info.k = read_only(np.ones(9))
    messages: tuple[Image, CameraInfo] = image, info
    DepthProjector([0.0, 0.0, 0.0]).points(*messages, a_pose(0))


def a_scan() -> LaserScan:
    """Returns a scan of three beams at time 0, two with returns."""
    scan: Any = zero_message("sensor_msgs/msg/LaserScan")
    scan.ranges = read_only(np.array([1.0, 2.0, np.inf], np.float32))
    scan.angle_increment, scan.range_max = 0.1, 10.0
    message: LaserScan = scan
    return message


def a_pose(time_ns: int) -> OdometrySample:
    """Returns a level pose at rest at the origin."""
    return OdometrySample(time_ns, np.zeros(3), rotations.IDENTITY.copy(), np.zeros(3), np.zeros(3))


def some_rays() -> Rays:
    """Returns the rays of `a_scan`, through the kernel that computes them."""
    motion = MotionHistory()
    for time_ns in (0, NS_PER_S // 10):
        motion.add(a_pose(time_ns))
    rays = RayMaker([0.0, 0.0, 0.0], Beams()).rays(a_scan(), motion, None)
    assert rays is not None
    return rays
