"""A value of another type than its field's is an error that names the field."""

import math

import numpy as np
import pytest

from volery.core.errors import GraphError
from volery.graph.message_copies import copy_message, message_checker
from volery.graph.messages import (
    Image,
    LaserScan,
    PathMessage,
    Pose,
    PoseStamped,
    String,
    Temperature,
    Twist,
    Vector3,
    message_type,
)


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
        (lambda: Twist(linear=Vector3("1", 0, 0)), "x must be a float64, not '1'"),
        (lambda: Twist(linear=3.0), "linear: geometry_msgs/msg/Vector3: must be a message"),
        (lambda: Twist(linear=Vector3), "not the class"),
        (lambda: with_field(Twist(), liner=Vector3()), "no field 'liner'"),
        (lambda: Image(width=3.5), "width must be a uint32, not 3.5"),
        (lambda: Image(width=-1), "width must be a uint32, 0 to 4294967295, not -1"),
        (lambda: Image(is_bigendian=300), "0 to 255, not 300"),
        (lambda: message_type("std_msgs/msg/Bool")(data=1), "must be a bool"),
        (nested, "x must be a float64, not 'far'"),
        (lambda: PathMessage(poses=[Pose()]), "poses[...]: geometry_msgs/msg/PoseStamped"),
        (lambda: PathMessage(poses=PoseStamped()), "poses must be a list"),
        (lambda: LaserScan(ranges=["near"]), "ranges"),
        (lambda: message_type("sensor_msgs/msg/JointState")(name=[1]), "name[...]"),
        (lambda: message_type("sensor_msgs/msg/JointState")(name="ab"), "must be a list"),
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
    ):
        assert copy_message(message) is not message
        message_checker(message.__msgtype__)(message)
