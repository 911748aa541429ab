"""A value of another type than its field's is an error that names the field."""

import array
import math
import sys
from collections import deque

import numpy as np
import pytest

from volery.core.errors import GraphError
from volery.graph.message_copies import copy_message, message_checker, receive_message
from volery.graph.messages import (
    Image,
    LaserScan,
    OccupancyGrid,
    PathMessage,
    Pose,
    PoseStamped,
    PoseWithCovariance,
    String,
    Temperature,
    Twist,
    Vector3,
    message_type,
)

FLOAT = message_type("std_msgs/msg/Float32")


def with_field(message, **values):
    for name, value in values.items():
        setattr(message, name, value)
    return message


def nested():
    path = PathMessage(poses=[PoseStamped(), PoseStamped()])
    path.poses[1].pose.position.x = "far"
    return path


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: String(7), "std_msgs/msg/String: data must be a string, not 7 (int)"),
        (lambda: String(None), "data must be a string, not None"),
        (lambda: String(b"x"), "data must be a string"),
        (lambda: Twist(linear=Vector3("1", 0, 0)), "Twist: linear.x must be a float64, not '1'"),
        (
            lambda: Twist(linear=3.0),
            "linear must be a message of type geometry_msgs/msg/Vector3, not 3.0",
        ),
        (lambda: Twist(linear=Vector3), "not the class"),
        (lambda: with_field(Twist(), liner=Vector3()), "no field 'liner'"),
        (lambda: Image(width=3.5), "width must be a uint32, not 3.5"),
        (lambda: Image(width=-1), "width must be a uint32, 0 to 4294967295, not -1"),
        (
            lambda: message_type("std_msgs/msg/Int32")(2**40),
            "data must be an int32, -2147483648 to",
        ),
        (
            lambda: Twist(linear=with_field(Vector3(), w=1.0)),
            "Twist: linear has no field 'w'; fields: x, y, z",
        ),
        (lambda: OccupancyGrid(data=np.array([100, 200], np.uint8)), "-128 to 127, not 200"),
        (lambda: OccupancyGrid(data=array.array("B", [255])), "data must be int8, -128 to 127"),
        (lambda: OccupancyGrid(data=b"\xff"), "data must be int8, -128 to 127, not 255"),
        (lambda: FLOAT(data=1e300), "data must be a float32, at most 3.402824e+38, not 1e+300"),
        (lambda: FLOAT(data=-(10**40)), "data must be a float32, at most"),
        (lambda: LaserScan(ranges=[1.0, sys.float_info.max]), "ranges must be float32, at most"),
        (lambda: LaserScan(ranges=np.array([-1e39, 1.0])), "ranges must be float32, at most"),
        (lambda: Image(is_bigendian=300), "0 to 255, not 300"),
        (lambda: message_type("std_msgs/msg/Bool")(data=1), "must be a bool"),
        (nested, "nav_msgs/msg/Path: poses[1].pose.position.x must be a float64, not 'far'"),
        (
            lambda: PathMessage(poses=[Pose()]),
            "poses[0] must be a message of type geometry_msgs/msg/PoseStamped",
        ),
        (lambda: PathMessage(poses=PoseStamped()), "poses must be a list"),
        (lambda: LaserScan(ranges=["near"]), "ranges"),
        (
            lambda: message_type("sensor_msgs/msg/JointState")(name=["a", 1]),
            "name[1] must be a string, not 1",
        ),
        (lambda: message_type("sensor_msgs/msg/JointState")(name="ab"), "must be a list"),
        (lambda: String("\ud800"), "data contains half a surrogate pair"),
        (lambda: LaserScan(ranges=np.ones((2, 2), np.float32)), "an array of shape (2, 2)"),
        (lambda: LaserScan(ranges=np.ones((2, 2))), "an array of shape (2, 2)"),
        (lambda: LaserScan(ranges=[[1.0], [2.0]]), "ranges[0] must be a number of float32"),
        (lambda: LaserScan(ranges=[1.0, "2"]), "ranges[1] must be a number of float32, not '2'"),
        (lambda: LaserScan(ranges=[1.0, None]), "ranges[1]"),
        (lambda: LaserScan(ranges=3.0), "ranges must be a sequence of numbers, not 3.0"),
        (lambda: LaserScan(ranges="123"), "ranges must be a sequence of numbers, not '123'"),
        (lambda: Image(data=[1, 256]), "data must be uint8, 0 to 255, not 256"),
        (lambda: Image(data=[1.5]), "data[0] must be a number of uint8"),
        (
            lambda: Image(data=np.array([1.5, 300.0])),
            "data must be numbers of uint8, not of float64",
        ),
        (lambda: Image(data=np.array([-1])), "not -1"),
        (lambda: Image(data=[np.int64(300)]), "not 300"),
        (lambda: Image(data=[2**70]), "data"),
        (lambda: PoseWithCovariance(covariance=np.eye(5)), "must have 36 numbers, not 25"),
    ],
)
def test_wrong_types(make, words):
    message = make()
    for look in (copy_message, message_checker(message.__msgtype__)):
        with pytest.raises(GraphError) as caught:
            look(message)
        assert words in str(caught.value)


def test_what_fits():
    for message in (
        Twist(linear=Vector3(1, np.float32(2.0), math.nan)),
        Temperature(temperature=np.int64(3)),
        Image(width=np.uint32(3), data=bytes(3)),
        message_type("std_msgs/msg/Bool")(data=np.bool_(True)),
        LaserScan(ranges=[1, 2.5]),
        PathMessage(poses=(PoseStamped(),)),
        PathMessage(poses=deque([PoseStamped()])),
        message_type("sensor_msgs/msg/JointState")(name={"a"}, position=range(3)),
        String("grüße"),
        Image(data=np.array([1, 255])),
        Image(data=[True, np.uint8(2)]),
        Image(data=[]),
        LaserScan(ranges=np.arange(3)),
        LaserScan(ranges=[math.inf, -math.inf, math.nan, 3.4028235e38]),
        LaserScan(ranges=np.array([math.inf, math.nan, -3.4028235e38])),
        FLOAT(data=math.inf),
        FLOAT(data=math.nan),
        FLOAT(data=-3.4028235e38),
        OccupancyGrid(data=np.array([100, 0], np.uint8)),
        OccupancyGrid(data=b"\x64"),
        message_type("std_msgs/msg/ByteMultiArray")(data=np.array([200], np.uint8)),
    ):
        assert copy_message(message) is not message
        message_checker(message.__msgtype__)(message)


def test_fixed_arrays_may_have_any_shape():
    """As in rclpy, which compares sizes: a covariance is often a matrix."""
    copied = copy_message(PoseWithCovariance(covariance=np.eye(6)))
    assert copied.covariance.tolist() == np.eye(6).ravel().tolist()


@pytest.mark.parametrize("values", [np.zeros(36), np.zeros((6, 6)), array.array("d", [0.0] * 36)])
def test_a_copy_has_arrays_of_its_own(values):
    copied = copy_message(PoseWithCovariance(covariance=values))
    values[0] = 7.0
    assert copied.covariance[0] == 0.0
    assert not copied.covariance.flags.writeable


@pytest.mark.parametrize("level", [b"\x02", 2])
def test_a_byte_is_bytes_or_a_number(level):
    """`byte` of rclpy is `bytes` of length 1."""
    status = message_type("diagnostic_msgs/msg/DiagnosticStatus")
    assert copy_message(status(level=level)).level == 2
    many = message_type("std_msgs/msg/ByteMultiArray")(data=[b"\x01", b"\x02"])
    assert copy_message(many).data.tolist() == [1, 2]
    with pytest.raises(GraphError, match="level must be a byte"):
        copy_message(status(level=b"no"))


def test_a_node_treats_a_byte_as_number_and_as_bytes():
    status = message_type("diagnostic_msgs/msg/DiagnosticStatus")
    found = receive_message(copy_message(status(level=status.WARN)))
    assert found.level == status.WARN == 1
    assert found.level == b"\x01" == status.WARN
    assert found.level != b"\x02"
    assert found.level != status.ERROR
    assert int.from_bytes(found.level, "little") == found.level[0] == 1
    assert {1: "warned"}[found.level] == "warned"
    assert status().level == status.OK == b"\x00"
    assert not status().level
    assert copy_message(status(level=found.level)).level == 1
    far = receive_message(copy_message(status(level=b"\xff")))
    assert (far.level, bytes(far.level)) == (-1, b"\xff")
