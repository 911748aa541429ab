"""Provides the ROS 2 message types of Volery, and published messages.

Types are plain dataclasses with numpy arrays from `rosbags`; no ROS installation is needed. Types
that `rosbags` lacks come from the definition files in `definitions/`. Every argument of a message
class is optional, as in rclpy: see `message_defaults`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys.stores import ros2_jazzy as _ros2

from volery.core.clock import NS_PER_S, stamp_from_ns
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.lazy_list import LazyList
from volery.graph.typestore import typestore

Time = _ros2.builtin_interfaces__msg__Time
Point = _ros2.geometry_msgs__msg__Point
Point32 = _ros2.geometry_msgs__msg__Point32
PointStamped = _ros2.geometry_msgs__msg__PointStamped
Polygon = _ros2.geometry_msgs__msg__Polygon
PolygonStamped = _ros2.geometry_msgs__msg__PolygonStamped
Pose = _ros2.geometry_msgs__msg__Pose
PoseStamped = _ros2.geometry_msgs__msg__PoseStamped
PoseWithCovariance = _ros2.geometry_msgs__msg__PoseWithCovariance
Quaternion = _ros2.geometry_msgs__msg__Quaternion
Transform = _ros2.geometry_msgs__msg__Transform
TransformStamped = _ros2.geometry_msgs__msg__TransformStamped
Twist = _ros2.geometry_msgs__msg__Twist
TwistStamped = _ros2.geometry_msgs__msg__TwistStamped
TwistWithCovariance = _ros2.geometry_msgs__msg__TwistWithCovariance
TwistWithCovarianceStamped = _ros2.geometry_msgs__msg__TwistWithCovarianceStamped
Vector3 = _ros2.geometry_msgs__msg__Vector3
MapMetaData = _ros2.nav_msgs__msg__MapMetaData
OccupancyGrid = _ros2.nav_msgs__msg__OccupancyGrid
PathMessage = _ros2.nav_msgs__msg__Path
Odometry = _ros2.nav_msgs__msg__Odometry
Clock = _ros2.rosgraph_msgs__msg__Clock
CameraInfo = _ros2.sensor_msgs__msg__CameraInfo
CompressedImage = _ros2.sensor_msgs__msg__CompressedImage
Image = _ros2.sensor_msgs__msg__Image
RegionOfInterest = _ros2.sensor_msgs__msg__RegionOfInterest
FluidPressure = _ros2.sensor_msgs__msg__FluidPressure
BatteryState = _ros2.sensor_msgs__msg__BatteryState
Imu = _ros2.sensor_msgs__msg__Imu
JointState = _ros2.sensor_msgs__msg__JointState
Log = _ros2.rcl_interfaces__msg__Log
LaserEcho = _ros2.sensor_msgs__msg__LaserEcho
LaserScan = _ros2.sensor_msgs__msg__LaserScan
MagneticField = _ros2.sensor_msgs__msg__MagneticField
NavSatFix = _ros2.sensor_msgs__msg__NavSatFix
NavSatStatus = _ros2.sensor_msgs__msg__NavSatStatus
MultiEchoLaserScan = _ros2.sensor_msgs__msg__MultiEchoLaserScan
PointCloud2 = _ros2.sensor_msgs__msg__PointCloud2
PointField = _ros2.sensor_msgs__msg__PointField
Range = _ros2.sensor_msgs__msg__Range
Temperature = _ros2.sensor_msgs__msg__Temperature
Bool = _ros2.std_msgs__msg__Bool
Float32 = _ros2.std_msgs__msg__Float32
Header = _ros2.std_msgs__msg__Header
String = _ros2.std_msgs__msg__String
TFMessage = _ros2.tf2_msgs__msg__TFMessage
MultiDOFJointTrajectory = _ros2.trajectory_msgs__msg__MultiDOFJointTrajectory
MultiDOFJointTrajectoryPoint = _ros2.trajectory_msgs__msg__MultiDOFJointTrajectoryPoint


def add_definitions(folder: str | Path, *, foreign: bool = False) -> list[str]:
    """Registers the `.msg`, `.srv` and `.action` files of a folder of packages.

    Returns the names of the types, `package/srv/Name_Request` and `_Response` for a service.

    foreign: the files come from a log and are not trusted.

    Raises `GraphError` if a definition is broken, too large, names an unknown type or contradicts a
    known type; the message names file and line, and none of the folder's types is registered.
    """
    return typestore().add_folder(Path(folder), foreign=foreign)


def __getattr__(name: str) -> Any:
    """Returns classes of definition files by their Python name, so that messages can be pickled."""
    if "__" in name.strip("_"):
        found = typestore().types.get(name.replace("__", "/"))
        if found is not None:
            return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def message_type(name: str) -> type[Any]:
    """Returns the dataclass of a type such as `sensor_msgs/msg/LaserScan`, or raises `KeyError`."""
    return typestore().types[name]


def type_name(message_class: type[Any]) -> str:
    """Returns the ROS 2 name of a message dataclass."""
    name: str = message_class.__msgtype__
    return name


def time_from_ns(time_ns: int) -> Time:
    """Returns a simulated time as ROS time."""
    return Time(*stamp_from_ns(time_ns))


def header(time_ns: int, frame_id: str) -> Header:
    """Returns a header stamped with simulated time."""
    return Header(time_from_ns(time_ns), frame_id)


def frame_name(name: str) -> str:
    """Returns the name of a frame without a leading slash, which ROS 1 wrote and tf2 ignores."""
    return name.removeprefix("/")


def frame_of(message: Any) -> str:
    """Returns the frame of a message's header, as `frame_name`."""
    return frame_name(message.header.frame_id)


def single(value: float) -> float:
    """Returns the value rounded to float32, so that nodes receive what is sent on the wire."""
    return float(np.float32(value))


def stamp_of(message: Any) -> int:
    """Returns the stamp of a message's header, ns; 0 without a header."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return 0 if stamp is None else int(stamp.sec * NS_PER_S + stamp.nanosec)


@dataclass(frozen=True)
class Published:
    """One message on one topic. Its arrays are read-only; its encodings are cached on demand."""

    topic: str
    """Full name of the topic."""
    msgtype: str
    """ROS 2 name of the message's type."""
    time_ns: int
    """Simulated time of publication."""
    message: Any
    """The message, a dataclass with numpy arrays."""

    @cached_property
    def cdr(self) -> bytes:
        """The message in CDR, the ROS 2 wire format."""
        transforms = getattr(self.message, "transforms", None)
        if isinstance(transforms, LazyList) and transforms.cdr is not None:
            return transforms.cdr()
        return bytes(typestore().serialize_cdr(self.message, self.msgtype))

    @cached_property
    def ros1(self) -> bytes:
        """The message in the ROS 1 wire format; `seq` of headers is 0."""
        return ros1_codec().encode(self.message, self.msgtype)
