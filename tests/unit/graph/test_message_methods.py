"""Message classes compare, print and name their fields as those of rclpy."""

import copy
import pickle

import numpy as np

from volery.graph.message_copies import copy_message, receive_message
from volery.graph.messages import (
    LaserScan,
    Odometry,
    PoseStamped,
    PoseWithCovariance,
    String,
    Twist,
    Vector3,
    message_type,
)


def test_messages_with_arrays_compare():
    a, b = Odometry(), Odometry()
    assert a == b
    b.pose.covariance[7] = 1.0
    assert a != b
    scan, other = LaserScan(ranges=[1.0, 2.0]), LaserScan(ranges=np.array([1.0, 2.0], np.float32))
    assert scan == other
    other.ranges = [1.0]
    assert scan != other
    received = [receive_message(copy_message(scan)) for _ in range(2)]
    assert received[0] == received[1] == copy_message(scan)
    assert String() != Twist()
    assert (String() == 3) is False


def test_lists_of_messages_compare():
    path = message_type("nav_msgs/msg/Path")
    assert path(poses=[PoseStamped()]) == path(poses=(PoseStamped(),))
    moved = PoseStamped()
    moved.pose.position.x = 1.0
    assert path(poses=[moved]) != path(poses=[PoseStamped()])


def test_the_text_of_a_message():
    assert repr(Vector3(x=1.0)) == "geometry_msgs.msg.Vector3(x=1.0, y=0.0, z=0.0)"
    assert str(String(data="a")) == "std_msgs.msg.String(data='a')"
    assert "ranges=[1.0, 2.0], intensities=[]" in repr(LaserScan(ranges=[1.0, 2.0]))
    received = receive_message(copy_message(LaserScan(ranges=[1.0, 2.0])))
    assert "ranges=[1.0, 2.0], intensities=[]" in repr(received)
    assert (String.__name__, type(Twist()).__name__) == ("String", "Twist")
    assert message_type("std_srvs/srv/SetBool_Request").__name__ == "SetBool_Request"


def test_names_and_types_of_fields():
    assert Twist.get_fields_and_field_types() == {
        "linear": "geometry_msgs/Vector3",
        "angular": "geometry_msgs/Vector3",
    }
    assert PoseWithCovariance().get_fields_and_field_types()["covariance"] == "double[36]"
    assert message_type("std_srvs/srv/Trigger_Request").get_fields_and_field_types() == {}
    assert Twist.__slots__ == Twist().__slots__ == ["_linear", "_angular"]
    twist = Twist(linear=Vector3(x=1.0))
    assert [getattr(twist, slot) for slot in twist.__slots__] == [twist.linear, twist.angular]
    assert not hasattr(twist, "_lateral")


def test_copies_and_pickles_hold_the_fields_alone():
    for message in (Twist(), Odometry(), message_type("std_srvs/srv/SetBool_Request")(data=True)):
        for twin in (copy.deepcopy(message), pickle.loads(pickle.dumps(message))):
            assert twin == message
            assert vars(twin).keys() == vars(message).keys()
            copy_message(twin)
