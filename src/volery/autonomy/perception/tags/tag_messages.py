"""Messages of detected tags."""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.autonomy.perception.tags.detector import FAMILY
from volery.autonomy.perception.tags.tag_pose import TagPose
from volery.core.arrays import Array
from volery.graph.messages import (
    Header,
    Point,
    Pose,
    PoseWithCovariance,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    message_type,
)

DETECTIONS_TYPE = "vision_msgs/msg/Detection3DArray"


def class_of(tag_id: int) -> str:
    """Returns the class of a detection, such as `36h11:7`."""
    return f"{FAMILY}:{tag_id}"


def id_of(class_id: str) -> int | None:
    """Returns the number of a tag from the class of a detection; None for other classes."""
    family, _, number = class_id.partition(":")
    return int(number) if family == FAMILY and number.isascii() and number.isdigit() else None


def detection(header: Header, tag_id: int, pose: TagPose, covariance: Array, size_m: float) -> Any:
    """Returns a `vision_msgs/Detection3D`; covariance: (3, 3) of the position, m2.

    The covariance of the attitude is unknown: its variances are -1.
    """
    make = {
        name: message_type(f"vision_msgs/msg/{name}")
        for name in ("ObjectHypothesis", "ObjectHypothesisWithPose", "BoundingBox3D", "Detection3D")
    }
    whole = np.zeros((6, 6))
    whole[:3, :3] = covariance
    whole[3:, 3:] = -np.eye(3)
    placed = _pose(pose)
    hypothesis = make["ObjectHypothesisWithPose"](
        make["ObjectHypothesis"](class_of(tag_id), 1.0), PoseWithCovariance(placed, whole.ravel())
    )
    box = make["BoundingBox3D"](placed, Vector3(size_m, size_m, 0.0))
    return make["Detection3D"](header, [hypothesis], box, class_of(tag_id))


def transform(header: Header, child: str, pose: TagPose) -> TFMessage:
    """Returns the transform from the header's frame to the frame `child` of the tag."""
    placed = _pose(pose)
    p = placed.position
    shift = Transform(Vector3(p.x, p.y, p.z), placed.orientation)
    return TFMessage([TransformStamped(header, child, shift)])


def _pose(pose: TagPose) -> Pose:
    return Pose(Point(*pose.position.tolist()), Quaternion(*pose.attitude.tolist()))
