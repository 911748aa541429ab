"""Moves messages into another frame: the contents of `tf2_geometry_msgs` and `tf2_sensor_msgs`.

Each function returns a new message with the header of the transform, `T_target_source`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from volery.core import rotations
from volery.core.arrays import Array
from volery.graph.messages import (
    Point,
    PointCloud2,
    PointStamped,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    Vector3,
    message_type,
)
from volery.graph.nodes.point_cloud2 import read_points

_VECTOR = "geometry_msgs/msg/Vector3Stamped"
_WITH_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"


def do_transform_point(point: Any, transform: Any) -> Any:
    """Returns a PointStamped in the transform's frame."""
    return PointStamped(transform.header, Point(*_moved(transform, point.point).tolist()))


def do_transform_vector3(vector3: Any, transform: Any) -> Any:
    """Returns a Vector3Stamped in the transform's frame: turned, not moved."""
    v = vector3.vector
    turned = rotations.rotate(_rotation(transform), [v.x, v.y, v.z])
    return message_type(_VECTOR)(transform.header, Vector3(*turned.tolist()))


def do_transform_pose(pose: Any, transform: Any) -> Any:
    """Returns a Pose in the transform's frame."""
    q = pose.orientation
    turned = rotations.multiply(_rotation(transform), [q.x, q.y, q.z, q.w])
    return Pose(Point(*_moved(transform, pose.position).tolist()), Quaternion(*turned.tolist()))


def do_transform_pose_stamped(pose: Any, transform: Any) -> Any:
    """Returns a PoseStamped in the transform's frame."""
    return PoseStamped(transform.header, do_transform_pose(pose.pose, transform))


def do_transform_pose_with_covariance_stamped(pose: Any, transform: Any) -> Any:
    """Returns a PoseWithCovarianceStamped in the transform's frame; the covariance is turned."""
    turn = np.kron(np.eye(2), rotations.matrix(_rotation(transform)))
    covariance = turn @ np.asarray(pose.pose.covariance).reshape(6, 6) @ turn.T
    moved = PoseWithCovariance(do_transform_pose(pose.pose.pose, transform), covariance.ravel())
    return message_type(_WITH_COVARIANCE)(transform.header, moved)


def do_transform_cloud(cloud: Any, transform: Any) -> Any:
    """Returns a PointCloud2 with x, y, z in the transform's frame; other fields stay as they are.

    Raises `ValueError` if the cloud has no x, y, z.
    """
    points = read_points(cloud)
    missing = [name for name in "xyz" if name not in (points.dtype.names or ())]
    if missing:
        raise ValueError(f"the cloud has no field {', '.join(missing)}")
    points = points.copy()
    positions = np.stack([points[name].astype(np.float64) for name in "xyz"], axis=-1)
    p = transform.transform.translation
    moved = rotations.rotate(_rotation(transform), positions) + np.array([p.x, p.y, p.z])
    for k, name in enumerate("xyz"):
        points[name] = moved[:, k]
    return PointCloud2(
        header=transform.header,
        height=cloud.height,
        width=cloud.width,
        fields=list(cloud.fields),
        is_bigendian=False,
        point_step=points.dtype.itemsize,
        row_step=points.dtype.itemsize * cloud.width,
        data=np.frombuffer(points.tobytes(), np.uint8),
        is_dense=cloud.is_dense,
    )


BY_TYPE: dict[str, Callable[[Any, Any], Any]] = {
    "geometry_msgs/msg/PointStamped": do_transform_point,
    "geometry_msgs/msg/PoseStamped": do_transform_pose_stamped,
    "sensor_msgs/msg/PointCloud2": do_transform_cloud,
    _VECTOR: do_transform_vector3,
    _WITH_COVARIANCE: do_transform_pose_with_covariance_stamped,
}
"""Functions by the type of the stamped message that each moves."""


def _rotation(transform: Any) -> Array:
    q = transform.transform.rotation
    return np.array([q.x, q.y, q.z, q.w])


def _moved(transform: Any, position: Any) -> Array:
    p = transform.transform.translation
    turned = rotations.rotate(_rotation(transform), [position.x, position.y, position.z])
    return np.asarray(turned + np.array([p.x, p.y, p.z]))


def contents() -> dict[str, dict[str, Any]]:
    """Returns the names and values of each module."""
    moves = {each.__name__: each for each in BY_TYPE.values() if each is not do_transform_cloud}
    types = {name.rpartition("/")[2]: message_type(name) for name in BY_TYPE}
    geometry = {**moves, "do_transform_pose": do_transform_pose, **types}
    cloud = {"do_transform_cloud": do_transform_cloud}
    return {
        "tf2_geometry_msgs": geometry,
        "tf2_geometry_msgs.tf2_geometry_msgs": geometry,
        "tf2_sensor_msgs": cloud,
        "tf2_sensor_msgs.tf2_sensor_msgs": cloud,
    }
