"""Odometry as poses in the map: what `/tf` says of a UAV's odometry frame is put before it.

`map -> uavN/odom` is identity until a SLAM, or whoever corrects the drift, says otherwise
(REP-105).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.scan_points import Pose
from volery.core import rotations
from volery.graph.messages import Odometry, TFMessage

Array = NDArray[np.float64]


class MapPoses:
    """Knows where odometry frames lie in the map."""

    def __init__(self) -> None:
        self._frames: dict[str, tuple[Array, Array]] = {}
        """Position (3,) and attitude (4,) in the map, by name."""

    def on_tf(self, message: TFMessage) -> None:
        """Take in what `/tf` says of frames in the map; what is not finite is left out."""
        for each in message.transforms:
            p, q = each.transform.translation, each.transform.rotation
            place, turn = np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])
            length = float(np.linalg.norm(turn))
            fine = np.isfinite(place).all() and 0.9 < length < 1.1
            if fine and each.header.frame_id == "map" and each.child_frame_id.endswith("/odom"):
                self._frames[each.child_frame_id] = (place, turn / length)

    def of(self, message: Odometry) -> Pose:
        """The pose in the map."""
        pose = Pose.from_odometry(message)
        frame = self._frames.get(message.header.frame_id)
        if frame is None:
            return pose
        place, turn = frame
        return Pose(
            pose.time_ns,
            place + rotations.rotate(turn, pose.position),
            rotations.multiply(turn, pose.attitude),
            rotations.rotate(turn, pose.velocity),
            pose.omega_body,
        )
