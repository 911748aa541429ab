"""What nodes on a sourced rclpy need of it, as far as that can be seen without one."""

from __future__ import annotations

import importlib.util
from enum import Enum
from types import SimpleNamespace

import pytest

from volery.bridges.ros2.environment import Ros2Environment, join_ros2
from volery.bridges.ros2.middleware import Profile, RemotePublisher
from volery.bridges.ros2.rcl import types
from volery.bridges.ros2.rcl.qos import remote_publisher
from volery.cli.connections import _ros2_terms, open_link
from volery.core.errors import BridgeError, GraphError

SCAN = "sensor_msgs/msg/LaserScan"
HASH = "RIHS01_" + "ab" * 32


class Reliability(Enum):
    """As rclpy numbers and names them."""

    RELIABLE = 1
    BEST_EFFORT = 2


class Durability(Enum):
    TRANSIENT_LOCAL = 1
    VOLATILE = 2


def test_fields_are_described_in_the_words_of_rosidl():
    assert types.described("nav_msgs/msg/MapMetaData") == {
        "map_load_time": "builtin_interfaces/Time",
        "resolution": "float",
        "width": "uint32",
        "height": "uint32",
        "origin": "geometry_msgs/Pose",
    }
    assert types.described("geometry_msgs/msg/PoseWithCovariance")["covariance"] == "double[36]"
    assert types.described("sensor_msgs/msg/Image")["data"] == "sequence<uint8>"
    assert types.described("tf2_msgs/msg/TFMessage") == {
        "transforms": "sequence<geometry_msgs/TransformStamped>"
    }
    assert types.described("std_srvs/srv/Trigger_Request") == {}
    descriptor = types.described("rcl_interfaces/msg/ParameterDescriptor")
    assert descriptor["read_only"] == "boolean"
    assert descriptor["integer_range"] == "sequence<rcl_interfaces/IntegerRange, 1>"
    assert types.described("rcl_interfaces/msg/ParameterValue")["byte_array_value"] == (
        "sequence<octet>"
    )


@pytest.mark.parametrize(
    "change",
    [{"range_max": "double"}, {"extra": "float"}, {"ranges": "sequence<float, 1081>"}],
)
def test_other_definitions_are_refused(change):
    fields = types.described(SCAN) | change
    theirs = SimpleNamespace(get_fields_and_field_types=lambda: fields)
    with pytest.raises(GraphError, match=f"another definition of '{SCAN}'"):
        types._compare(SCAN, theirs)


def test_the_order_of_fields_counts():
    fields = dict(reversed(types.described("geometry_msgs/msg/Vector3").items()))
    theirs = SimpleNamespace(get_fields_and_field_types=lambda: fields)
    with pytest.raises(GraphError, match="another definition"):
        types._compare("geometry_msgs/msg/Vector3", theirs)


def test_types_within_are_looked_for_too():
    """Of a header only the outside is there."""
    theirs = SimpleNamespace(get_fields_and_field_types=lambda: types.described(SCAN))
    with pytest.raises(GraphError, match="no type 'std_msgs/msg/Header'"):
        types._compare(SCAN, theirs)


def test_publishers_of_others_are_described():
    info = SimpleNamespace(
        topic_type=SCAN,
        topic_type_hash=HASH,
        qos_profile=SimpleNamespace(
            reliability=Reliability.BEST_EFFORT, durability=Durability.VOLATILE
        ),
    )
    assert remote_publisher("/scan", info) == RemotePublisher(
        "/scan", SCAN, Profile(reliable=False), HASH
    )
    info.qos_profile = SimpleNamespace(
        reliability=Reliability.RELIABLE, durability=Durability.TRANSIENT_LOCAL
    )
    del info.topic_type_hash  # Humble
    assert remote_publisher("/map", info) == RemotePublisher(
        "/map", SCAN, Profile(latched=True), None
    )


@pytest.mark.skipif(importlib.util.find_spec("rclpy") is not None, reason="a ROS 2 is sourced")
def test_without_a_sourced_ros2_that_is_said():
    with pytest.raises(BridgeError, match="source a ROS 2"):
        join_ros2(Ros2Environment("rclpy"))
    with pytest.raises(BridgeError, match="source a ROS 2"):
        open_link("rclpy://7", "x")


def test_addresses_of_a_ros2_graph():
    assert _ros2_terms("rclpy") == Ros2Environment("rclpy")
    assert _ros2_terms("rclpy://7") == Ros2Environment("rclpy", 7)
    assert _ros2_terms("ros2://7?interface=lo") == Ros2Environment("dds", 7, ("lo",))
    for wrong, why in (
        ("rclpy://x", "a domain is a number from 0 to 232, not 'x'"),
        ("rclpy://7?interface=lo", "interface"),
        ("rclpy://7/x", "7/x"),
    ):
        with pytest.raises(BridgeError, match=why):
            _ros2_terms(wrong)
