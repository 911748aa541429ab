"""Messages: the ROS 2 types that Volery speaks, and what a published one carries.

Types are plain dataclasses with numpy arrays from `rosbags`; no ROS installation is needed.
Types that its store lacks come from the definition files in `definitions/`. Every argument of a
message class may stay away, as in rclpy: see `message_defaults`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.stores import ros2_jazzy as _ros2

from volery.core.clock import NS_PER_S, stamp_from_ns
from volery.graph.codecs.definition_store import DefinitionStore
from volery.graph.message_defaults import make_arguments_optional

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

_DEFINITIONS = Path(__file__).parent / "definitions"


@cache
def typestore() -> DefinitionStore:
    """The ROS 2 types (Jazzy) and those of our own definition files.

    The files are read one by one when a type of theirs is first asked for.
    """
    store = DefinitionStore(get_typestore(Stores.ROS2_JAZZY), __name__)
    store.index_folder(_DEFINITIONS)
    return store


_BASE_DEFAULTS = {("geometry_msgs/msg/Quaternion", "w"): 1.0}
"""Defaults in the definition files of ROS 2, which the types of `rosbags` do not keep."""


def _base_default(msgtype: str, field: str) -> Any:
    return _BASE_DEFAULTS.get((msgtype, field))


def _make_base_arguments_optional() -> None:
    base = get_typestore(Stores.ROS2_JAZZY)
    for name, cls in base.types.items():
        make_arguments_optional(name, cls, base.types, base.fielddefs, _base_default)


_make_base_arguments_optional()


def add_definitions(folder: str | Path, *, foreign: bool = False) -> list[str]:
    """Register the `.msg`, `.srv` and `.action` files of a folder of packages.

    Returns the names of the types, `package/srv/Name_Request` and `_Response` for a service.
    foreign: they come from a log, which may be a stranger's.

    Raises
    ------
    GraphError
        A definition is broken, too large to be used, names an unknown type or contradicts a type
        that is known; the message names file and line, and none of the folder's types is
        registered.

    """
    return typestore().add_folder(Path(folder), foreign=foreign)


def __getattr__(name: str) -> Any:
    """Classes of our definition files by their Python name, so that messages can be pickled."""
    if "__" in name.strip("_"):
        found = typestore().types.get(name.replace("__", "/"))
        if found is not None:
            return found
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def message_type(name: str) -> type[Any]:
    """Dataclass of a type name such as `sensor_msgs/msg/LaserScan`; `KeyError` if unknown."""
    return typestore().types[name]


def type_name(message_class: type[Any]) -> str:
    """ROS 2 name of a message dataclass."""
    name: str = message_class.__msgtype__
    return name


def time_from_ns(time_ns: int) -> Time:
    """ROS time of a simulated instant."""
    return Time(*stamp_from_ns(time_ns))


def header(time_ns: int, frame_id: str) -> Header:
    """Header stamped with simulated time."""
    return Header(time_from_ns(time_ns), frame_id)


def single(value: float) -> float:
    """The value that a float32 field of a message holds: nodes inside get what goes out."""
    return float(np.float32(value))


def stamp_of(message: Any) -> int:
    """Stamp in a message's header, ns; 0 where it has none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return 0 if stamp is None else int(stamp.sec * NS_PER_S + stamp.nanosec)


@dataclass(frozen=True)
class Published:
    """One message on one topic. Its arrays are read-only; its bytes are made once, on demand."""

    topic: str
    msgtype: str
    time_ns: int
    """Simulated time of publication."""
    message: Any

    @cached_property
    def cdr(self) -> bytes:
        """The message in CDR, the ROS 2 wire form."""
        return bytes(typestore().serialize_cdr(self.message, self.msgtype))

    @cached_property
    def ros1(self) -> bytes:
        """The message in ROS 1's wire form; its headers' `seq` is 0."""
        from volery.graph.codecs.ros1 import ros1_codec  # it is built upon this module

        return ros1_codec().encode(self.message, self.msgtype)
