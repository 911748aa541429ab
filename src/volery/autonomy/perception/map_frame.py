"""The pose of a UAV's odometry frame in the map, from `/tf`.

`map -> uavN/odom` is identity until a SLAM, or another drift correction, publishes it (REP-105). A
SLAM that has lost tracking stops publishing it.
"""

from __future__ import annotations

import numpy as np

from volery.autonomy.perception.motion_history import Pose
from volery.autonomy.perception.scan_points import OdometrySample
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.rotation_kernels import moved_points
from volery.core.saved_state import SavedAttributes
from volery.core.vectors import norm
from volery.graph.messages import Odometry, TFMessage, frame_name, frame_of, stamp_of

MAP = "map"
UNKNOWN_POSE = "pose in the map unknown"
_SILENT_NS = NS_PER_S
"""Timeout of a transform, by the odometry's clock."""


class MapFrame(SavedAttributes):
    """The transform from one odometry frame to the map."""

    STATE = ("odom_frame", "_known", "_odom_ns", "_tf_ns")

    def __init__(self) -> None:
        self.odom_frame = ""
        """Name of the odometry frame; empty before it is known."""
        self._odom_ns = 0
        self._known: dict[str, Pose] = {}
        self._tf_ns: dict[str, int] = {}

    def on_odometry(self, message: Odometry) -> None:
        """Selects the frame of this odometry."""
        self.odom_frame, self._odom_ns = frame_of(message), stamp_of(message)

    def on_tf(self, message: TFMessage) -> None:
        """Stores the transforms of a message; ignores those that are not finite."""
        for stamped in message.transforms:
            if frame_of(stamped) != MAP or not frame_name(stamped.child_frame_id).endswith("/odom"):
                continue
            p, q = stamped.transform.translation, stamped.transform.rotation
            position, attitude = np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])
            length = norm(attitude)
            if np.isfinite(position).all() and 0.9 < length < 1.1:
                self._known[frame_name(stamped.child_frame_id)] = Pose(position, attitude / length)
                self._tf_ns[frame_name(stamped.child_frame_id)] = stamp_of(stamped)

    @property
    def map_from_odom(self) -> Pose | None:
        """`T_map_odom`; None: identity."""
        return self._known.get(self.odom_frame)

    @property
    def is_lost(self) -> bool:
        """Whether the transform has timed out while the odometry continues."""
        last_ns = self._tf_ns.get(self.odom_frame)
        return last_ns is not None and self._odom_ns - last_ns > _SILENT_NS

    def to_map(self, points_odom: Array) -> Array:
        """Transforms points (..., 3) from the odometry frame to the map."""
        at = self.map_from_odom
        if at is None:
            return points_odom
        flat = np.ascontiguousarray(points_odom, np.float64).reshape(-1, 3)
        return moved_points(flat, at.attitude, at.position).reshape(np.shape(points_odom))

    def to_odom(self, points_map: Array) -> Array:
        """Transforms points (..., 3) from the map to the odometry frame."""
        at = self.map_from_odom
        if at is None:
            return points_map
        return rotations.rotate(rotations.conjugate(at.attitude), points_map - at.position)

    def pose_in_map(self, message: Odometry) -> OdometrySample:
        """Returns the pose of odometry in the map, and selects its frame."""
        self.on_odometry(message)
        pose, at = OdometrySample.from_odometry(message), self.map_from_odom
        if at is None:
            return pose
        return OdometrySample(
            pose.time_ns,
            self.to_map(pose.position),
            rotations.multiply(at.attitude, pose.attitude),
            rotations.rotate(at.attitude, pose.velocity),
            pose.omega_body,
        )
