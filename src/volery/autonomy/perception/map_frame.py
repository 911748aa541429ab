"""Where a UAV's odometry frame lies in the map, as `/tf` tells.

`map -> uavN/odom` is identity until a SLAM, or whoever corrects the drift, says otherwise
(REP-105). A SLAM that has lost its place says nothing more.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.perception.motion_history import Pose
from volery.autonomy.perception.scan_points import OdometrySample
from volery.core import rotations
from volery.core.clock import NS_PER_S
from volery.core.rotation_kernels import moved_points
from volery.core.vectors import norm
from volery.graph.messages import Odometry, TFMessage, stamp_of

Array = NDArray[np.float64]

MAP = "map"
UNKNOWN_PLACE = "where in the map is not known"
_SILENT_NS = NS_PER_S
"""What `/tf` has told once it must tell again within this time of the odometry's clock."""


class MapFrame:
    """The transform from one odometry frame to the map."""

    def __init__(self) -> None:
        self.odom_frame = ""
        """Name of the odometry frame; empty before it is known."""
        self._odom_ns = 0
        self._known: dict[str, Pose] = {}
        self._told_ns: dict[str, int] = {}

    def hear(self, message: Odometry) -> None:
        """The frame of this odometry is the one looked up from now on."""
        self.odom_frame, self._odom_ns = message.header.frame_id, stamp_of(message)

    def on_tf(self, message: TFMessage) -> None:
        """Take in what `/tf` says; transforms that are not finite are left out."""
        for stamped in message.transforms:
            if stamped.header.frame_id != MAP or not stamped.child_frame_id.endswith("/odom"):
                continue
            p, q = stamped.transform.translation, stamped.transform.rotation
            position, attitude = np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])
            length = norm(attitude)
            if np.isfinite(position).all() and 0.9 < length < 1.1:
                self._known[stamped.child_frame_id] = Pose(position, attitude / length)
                self._told_ns[stamped.child_frame_id] = stamp_of(stamped)

    @property
    def map_from_odom(self) -> Pose | None:
        """`T_map_odom`; None where it is identity."""
        return self._known.get(self.odom_frame)

    @property
    def is_lost(self) -> bool:
        """Whether `/tf` has fallen silent about a frame whose odometry goes on."""
        told = self._told_ns.get(self.odom_frame)
        return told is not None and self._odom_ns - told > _SILENT_NS

    def to_map(self, points_odom: Array) -> Array:
        """Points (..., 3) of the odometry frame in the map."""
        at = self.map_from_odom
        if at is None:
            return points_odom
        flat = np.ascontiguousarray(points_odom, np.float64).reshape(-1, 3)
        return moved_points(flat, at.attitude, at.position).reshape(np.shape(points_odom))

    def to_odom(self, points_map: Array) -> Array:
        """Points (..., 3) of the map in the odometry frame."""
        at = self.map_from_odom
        if at is None:
            return points_map
        return rotations.rotate(rotations.conjugate(at.attitude), points_map - at.position)

    def pose_in_map(self, message: Odometry) -> OdometrySample:
        """The pose that odometry tells, in the map; its frame is the one looked up from now on."""
        self.hear(message)
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

    def get_state(self) -> dict[str, Any]:
        """What a snapshot keeps."""
        times = {"odom_ns": self._odom_ns, "told_ns": dict(self._told_ns)}
        return {"odom_frame": self.odom_frame, "known": dict(self._known), **times}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state."""
        self.odom_frame, self._known = state["odom_frame"], dict(state["known"])
        self._odom_ns, self._told_ns = state["odom_ns"], dict(state["told_ns"])
