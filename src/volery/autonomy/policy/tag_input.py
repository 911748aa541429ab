"""Receives detections of AprilTags for policies, and carries them on by odometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from volery.autonomy.perception.motion_history import MotionHistory
from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.perception.tags.tag_messages import DETECTIONS_TYPE, id_of
from volery.autonomy.policy.node_inputs import NodeInput
from volery.autonomy.policy.tag_terms import tag_from_uav, tag_observation
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.vectors import norm
from volery.graph.messages import Odometry, message_type, stamp_of
from volery.graph.nodes.node import Node

_MAX_DISTANCE_M = 1000.0
_MAX_TAGS = 600
"""More than a family has."""


@dataclass(frozen=True, eq=False)
class SeenTag:
    """The last detection of a tag, and the UAV's pose at its image, in the odometry frame."""

    time_ns: int
    position_optical: Array
    """(3,) m."""
    attitude_optical: Array
    """(4,) optical frame from tag."""
    position: Array
    """(3,) m."""
    attitude: Array
    """(4,)."""


class TagInput(NodeInput):
    """The last detection of each tag, from `tag_detection/detections`; empty arrays count, too.

    Parameter `tags` of the node: the topic. Detections that are not finite, or whose pose is not
    known at the time of their image, are left out.
    """

    STATE: ClassVar[tuple[str, ...]] = (*NodeInput.STATE, "_seen", "_history")
    what = "detections of tags"

    def __init__(self, node: Node, timeout_s: float) -> None:
        super().__init__(node, timeout_s)
        self._history = MotionHistory()
        self._seen: dict[int, SeenTag] = {}
        topic = str(node.declare_parameter("tags", "tag_detection/detections").value)
        odometry = str(node.get_parameter("odometry").value)
        node.create_subscription(Odometry, odometry, self._on_odometry, 20)
        node.create_subscription(message_type(DETECTIONS_TYPE), topic, self._on_detections, 5)

    def observation(self, parameters: Mapping[str, Any]) -> Array:
        """Returns the part `tag` (6,) at the newest odometry, by the parameters of the policy."""
        now = self._history.newest
        seen = self._seen.get(int(parameters["tag_id"]))
        terms = {name: float(parameters[name]) for name in ("range_m", "memory_s")}
        if now is None or seen is None:
            unseen = np.zeros(3), 0.0, np.float64(np.inf), np.array([0.0, 0.0, 0.0, 1.0])
            return tag_observation(*unseen, **terms)
        vector, yaw = tag_from_uav(
            seen.position_optical,
            seen.attitude_optical,
            seen.attitude,
            parameters["mount_m"],
            parameters["mount_rpy_deg"],
        )
        moved = now.position - seen.position
        age_s = max(now.time_ns - seen.time_ns, 0) / NS_PER_S
        return tag_observation(vector - moved, yaw, age_s, now.attitude, **terms)

    def _on_odometry(self, message: Odometry) -> None:
        self._history.add(OdometrySample.from_odometry(message))

    def _on_detections(self, message: Any) -> None:
        self._accept()
        time_ns = stamp_of(message)
        pose = self._history.at(time_ns)
        if pose is None:
            return
        for detection in message.detections[:_MAX_TAGS]:
            for result in detection.results[:1]:
                number = id_of(result.hypothesis.class_id)
                found = _pose_of(result.pose.pose)
                if number is None or number >= _MAX_TAGS or found is None:
                    continue
                self._seen[number] = SeenTag(time_ns, *found, pose.position, pose.attitude)


def _pose_of(pose: Any) -> tuple[Array, Array] | None:
    """Returns position and attitude of a message; None if they are impossible."""
    p, q = pose.position, pose.orientation
    position, attitude = np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])
    if not (np.isfinite(position).all() and np.isfinite(attitude).all()):
        return None
    length = float(norm(attitude))
    if float(np.abs(position).max()) > _MAX_DISTANCE_M or not 0.9 < length < 1.1:
        return None
    return position, attitude / length
