"""Names, type hashes, quality of service and the environment of ROS 2."""

from __future__ import annotations

import sys

import pytest

from volery.bridges.bridge_factory import BridgeOptions, make_bridge
from volery.bridges.ros2 import environment
from volery.bridges.ros2.dds.domain import configuration
from volery.bridges.ros2.middleware import Profile
from volery.bridges.ros2.names import (
    NodeName,
    check_name,
    dds_reply_topic,
    dds_request_topic,
    dds_topic,
    dds_type,
    ros_type,
    service_of,
    topic_of,
)
from volery.bridges.ros2.profiles import common_profile, profile_of
from volery.bridges.ros2.type_hashes import message_hash, service_hash
from volery.core.errors import BridgeError, GraphError
from volery.graph.codecs.cdr import decode_cdr, encode_cdr
from volery.graph.messages import add_definitions
from volery.graph.parameter_values import plain_of, type_of, value_message
from volery.graph.typestore import typestore


def is_allowed(name):
    try:
        check_name(name)
    except GraphError:
        return False
    return True


@pytest.mark.parametrize("name", ["/a", "/uav1/laser/horizontal/scan", "/_hidden/x9", "/a__b"])
def test_names_that_ros2_allows(name):
    assert is_allowed(name)


@pytest.mark.parametrize(
    "name", ["", "/", "a", "/a/", "//a", "/a//b", "/1a", "/uav-1", "/größe", "/a b", "/~x"]
)
def test_names_that_ros2_does_not_allow(name):
    with pytest.raises(GraphError, match="does not allow"):
        check_name(name)


def test_names_are_limited_in_length():
    check_name("/" + "a" * 246)
    with pytest.raises(GraphError, match="247"):
        check_name("/" + "a" * 247)


def test_what_dds_calls_them():
    assert dds_topic("/chatter") == "rt/chatter"
    assert dds_request_topic("/uav1/land") == "rq/uav1/landRequest"
    assert dds_reply_topic("/uav1/land") == "rr/uav1/landReply"
    assert dds_type("std_msgs/msg/String") == "std_msgs::msg::dds_::String_"
    assert ros_type("std_srvs::srv::dds_::Trigger_Request_") == "std_srvs/srv/Trigger_Request"
    assert ros_type("HelloWorld") is None
    assert topic_of("rt/chatter") == "/chatter"
    assert topic_of("ros_discovery_info") is None
    assert service_of("rq/uav1/landRequest") == "/uav1/land"
    assert service_of("rt/landRequest") is None


def test_nodes_have_namespaces():
    assert NodeName.of("/uav1/gap_following") == ("/uav1", "gap_following")
    assert NodeName.of("/volery") == ("/", "volery")
    assert NodeName.of("/volery").full == "/volery"
    assert NodeName.of("/a/b/c").full == "/a/b/c"


# What `ros2 topic info --verbose` prints for these types in Jazzy, and the examples of
# rmw_zenoh's design document.
HASHES = {
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "geometry_msgs/msg/Twist": "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "geometry_msgs/msg/TwistStamped": (
        "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"
    ),
}
ADD_TWO_INTS = "e118de6bf5eeb66a2491b5bda11202e7b68f198d6f67922cf30364858239c81a"


@pytest.mark.parametrize("msgtype", HASHES)
def test_hashes_of_well_known_messages(msgtype):
    assert message_hash(msgtype) == f"RIHS01_{HASHES[msgtype]}"


def test_the_hash_of_a_well_known_service(tmp_path):
    folder = tmp_path / "example_interfaces" / "srv"
    folder.mkdir(parents=True)
    (folder / "AddTwoInts.srv").write_text("int64 a\nint64 b\n---\nint64 sum\n")
    add_definitions(tmp_path)
    assert service_hash("example_interfaces/srv/AddTwoInts") == f"RIHS01_{ADD_TWO_INTS}"


def test_hashes_agree_with_those_of_rosbags():
    """But where ROS's char counts: there it is an uint8."""
    store = typestore()
    names = ["nav_msgs/msg/Odometry", "sensor_msgs/msg/PointCloud2", "tf2_msgs/msg/TFMessage"]
    assert [message_hash(n) for n in names] == [store.hash_rihs01(n) for n in names]
    assert message_hash("std_msgs/msg/Char") != store.hash_rihs01("std_msgs/msg/Char")


def test_quality_of_service_is_what_the_field_expects():
    def of(topic, msgtype, latched=False):
        return profile_of(topic, msgtype, latched=latched)

    for kind in ("LaserScan", "Image", "PointCloud2", "Imu", "NavSatFix", "Range"):
        assert of("/uav1/x", f"sensor_msgs/msg/{kind}") == Profile(reliable=False, depth=5)
    assert of("/uav1/odom", "nav_msgs/msg/Odometry") == Profile(depth=10)
    assert of("/uav1/joint_states", "sensor_msgs/msg/JointState").reliable
    assert of("/tf", "tf2_msgs/msg/TFMessage") == Profile(depth=100)
    for topic in ("/tf_static", "/map"):
        assert of(topic, "x/msg/Y", latched=True) == Profile(latched=True, depth=1)


def test_subscriptions_ask_what_all_publishers_offer():
    best = Profile(reliable=False)
    latched = Profile(latched=True)
    assert common_profile([]).reliable
    assert not common_profile([Profile(), best]).reliable
    assert common_profile([latched, latched]).latched
    assert not common_profile([latched, Profile()]).latched


@pytest.mark.parametrize(
    ("value", "kind"),
    [(True, 1), (7, 2), (1.5, 3), ("x", 4), ([True], 6), ([1, 2], 7), ([1, 2.5], 8), (("a",), 9)],
)
def test_values_of_parameters_survive(value, kind):
    message = value_message(value)
    assert message.type == type_of(value) == kind
    data = encode_cdr(message, "rcl_interfaces/msg/ParameterValue")
    back = plain_of(decode_cdr(data, "rcl_interfaces/msg/ParameterValue"))
    assert back == (list(value) if isinstance(value, tuple) else value)


@pytest.mark.parametrize("value", [None, {}, [], [1, "x"], 2**63])
def test_values_that_ros2_has_no_type_for_are_not_set(value):
    assert value_message(value).type == 0
    assert plain_of(value_message(value)) is None


def test_the_domain_is_that_of_the_environment(monkeypatch):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    assert environment.domain_of(None) == 0
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert environment.domain_of(None) == 42
    assert environment.domain_of(7) == 7
    for wrong in ("x", "-1", "233"):
        monkeypatch.setenv("ROS_DOMAIN_ID", wrong)
        with pytest.raises(BridgeError, match=r"ROS_DOMAIN_ID.*0 to 232"):
            environment.domain_of(None)


@pytest.mark.parametrize(
    ("middleware", "module"), [("dds", "cyclonedds.domain"), ("zenoh", "zenoh")]
)
def test_what_to_install_is_said(monkeypatch, tmp_path, middleware, module):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(BridgeError, match=r'pip install "volery\[ros2\]"'):
        environment.join_ros2(environment.Ros2Environment(middleware, 7))
    for name in [each for each in sys.modules if each.partition(".")[0] in module]:
        monkeypatch.delitem(sys.modules, name)
    (tmp_path / f"{module.partition('.')[0]}.py").write_text("raise OSError('libddsc.so is bad')")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(BridgeError, match=r"installed but cannot be imported: libddsc.so is bad"):
        environment.join_ros2(environment.Ros2Environment(middleware, 7))


def test_nothing_leaves_the_machine_unless_interfaces_are_named():
    here = configuration()
    assert 'address="127.0.0.1"' in here
    assert "<AllowMulticast>false" in here
    there = configuration(("eth0", "192.168.1.7"))
    assert 'name="eth0"' in there
    assert 'address="192.168.1.7"' in there
    assert "127.0.0.1" not in there
    with pytest.raises(BridgeError, match="is not a network interface"):
        environment.join_ros2(environment.Ros2Environment("dds", 7, ('"/><x',)))


def test_bridges_by_name(monkeypatch):
    assert make_bridge("ros2=7", BridgeOptions()).bridge._terms.domain_id == 7
    named = make_bridge("ros2", BridgeOptions(domain_id=9, interfaces=("eth0",))).bridge._terms
    assert named == ("dds", 9, ("eth0",), "")
    with pytest.raises(BridgeError, match="--ros2-interface"):
        make_bridge("ros2=10.0.0.1:7", BridgeOptions())
    zenoh = make_bridge("ros2-zenoh=10.0.0.7:7447", BridgeOptions(domain_id=3)).bridge._terms
    assert zenoh == ("zenoh", 3, (), "10.0.0.7:7447")
