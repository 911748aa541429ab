"""Tests optional arguments of message classes, and that published messages are copies."""

import dataclasses
import pickle

import numpy as np
import pytest

from volery.core.errors import GraphError
from volery.graph.codecs.cdr import decode_cdr, encode_cdr
from volery.graph.message_copies import copy_message
from volery.graph.messages import (
    JointState,
    LaserScan,
    PathMessage,
    PoseStamped,
    PoseWithCovariance,
    Quaternion,
    Twist,
    Vector3,
    message_type,
)
from volery.graph.typestore import typestore


def test_arguments_may_stay_away():
    assert Twist() == Twist(Vector3(0.0, 0.0, 0.0), Vector3(x=0.0))
    assert Vector3(x=1.0) == Vector3(1.0, 0.0, 0.0)
    assert Quaternion().w == 1.0  # as the definition file of ROS 2 says
    assert LaserScan().header.stamp.sec == 0
    with pytest.raises(TypeError, match="linaer"):
        Twist(linaer=Vector3())


def test_nested_defaults_are_new_each_time():
    one, other = Twist(), Twist()
    one.linear.x = 5.0
    assert other.linear.x == 0.0
    first, second = PoseWithCovariance(), PoseWithCovariance()
    first.covariance[0] = 1.0
    assert second.covariance[0] == 0.0
    assert PathMessage().poses is not PathMessage().poses


def test_every_type_can_be_made_and_written():
    for name in typestore().names():
        message = copy_message(message_type(name)())
        assert encode_cdr(message, name), name


def test_own_types_services_and_constants():
    response = message_type("std_srvs/srv/Trigger_Response")
    assert response(success=True).message == ""
    assert message_type("rcl_interfaces/msg/Log").FATAL == 50
    assert dataclasses.replace(Vector3(1.0, 2.0, 3.0), x=4.0).x == 4.0
    assert pickle.loads(pickle.dumps(Twist())) == Twist()


def test_a_copy_is_independent_and_holds_arrays():
    scan = LaserScan(ranges=[1, 2.5])
    scan.intensities.append(7.0)
    copy = copy_message(scan)
    assert copy.ranges.dtype == np.float32
    assert (copy.ranges.tolist(), copy.intensities.tolist()) == ([1.0, 2.5], [7.0])
    assert not copy.ranges.flags.writeable
    path = PathMessage()
    path.poses.append(PoseStamped())
    earlier = copy_message(path)
    path.poses.append(PoseStamped())
    path.header.frame_id = "map"
    assert (len(earlier.poses), earlier.header.frame_id) == (1, "")
    shared = np.zeros(3)
    shared.setflags(write=False)
    assert copy_message(JointState(position=shared)).position is shared


def test_what_comes_over_a_wire_is_what_was_published():
    state = copy_message(JointState(name=["a"], position=(1.0, 2.0), velocity=np.arange(2)))
    read = decode_cdr(encode_cdr(state, state.__msgtype__), state.__msgtype__)
    assert (read.name, read.position.tolist()) == (["a"], [1.0, 2.0])
    assert read.velocity.tolist() == [0.0, 1.0]


def test_numbers_that_do_not_fit_name_the_field():
    with pytest.raises(GraphError, match=r"JointState: position\[0\] must be a number"):
        copy_message(JointState(position=["far"]))
    with pytest.raises(GraphError, match="covariance: must have 36 numbers, not 3"):
        copy_message(PoseWithCovariance(covariance=[1.0, 2.0, 3.0]))
