"""Names that old tools wrote into logs: types, topics, frames, files."""

import struct

import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from volery import open_log
from volery.bridges.logs.records import LogWalk
from volery.core.errors import RecordingError
from volery.graph import messages as m


@pytest.fixture
def bag(tmp_path):
    """Returns a function that writes a ROS 1 bag of one message, and its path."""

    def write(topic, msgtype, definition, md5, data):
        path = tmp_path / "old.bag"
        with Writer(path) as writer:
            channel = writer.add_connection(topic, msgtype, msgdef=definition, md5sum=md5)
            writer.write(channel, 1_000_000_000, data)
        return path

    return write


@pytest.mark.parametrize("name", ["my_count", "count", "Count2_x"])
def test_types_with_any_name_of_ros1(bag, name):
    package = f"{name.lower()}_probe_msgs"
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("int32 n\n", f"{package}/msg/{name}"))
    full = f"{package}/msg/{name}"
    data = store.serialize_ros1(store.types[full](7), full)
    definition, md5 = store.generate_msgdef(full, ros_version=1)
    with open_log(bag("/probe/count", full, definition, md5, data)) as log:
        assert log["/probe/count"]["n"].tolist() == [7]


@pytest.mark.parametrize(
    ("name", "definition", "md5", "data", "field", "value"),
    [
        ("sum_probe_msgs/msg/A", "int32 a\n", "*", b"\4\0\0\0", "a", 4),  # of topic_tools
        ("sum_probe_msgs/msg/B", "\tint32\ta # x\r\n", "0" * 32, b"\5\0\0\0", "a", 5),
        ("std_msgs/msg/Int32", "uint8 MORE=1\nint32 data\n", "1" * 32, b"\6\0\0\0", "data", 6),
        ("geometry_msgs/msg/PointStamped", "  Header header\n  Point point\n", "2" * 32,
         struct.pack("<IIII3s3d", 1, 2, 3, 3, b"map", 1.0, 2.0, 7.0), "point.z", 7.0),  # rosnodejs
    ],
)  # fmt: skip
def test_a_log_s_own_definition_counts_more_than_its_checksum(
    bag, name, definition, md5, data, field, value
):
    with open_log(bag("/probe", name, definition, md5, data)) as log:
        assert log["/probe"][field].tolist() == [value]


def test_a_type_without_fields_has_no_text(bag):
    nothing = "d41d8cd98f00b204e9800998ecf8427e"
    with open_log(bag("/probe", "void_probe_msgs/msg/Go", "", nothing, b"")) as log:
        assert len(log["/probe"]) == 1


def test_an_unknown_type_without_definition_is_refused(bag):
    with (
        open_log(bag("/probe", "void_probe_msgs/msg/Lost", "", "3" * 32, b"")) as log,
        pytest.raises(RecordingError, match="is not known, and the log does not define it"),
    ):
        len(log["/probe"])


def test_a_known_type_of_another_version_without_a_usable_definition_is_refused(bag):
    path = bag("/probe", "std_msgs/msg/Int32", "int32 da(ta\n", "4" * 32, b"\6\0\0\0")
    with (
        open_log(path) as log,
        pytest.raises(RecordingError, match=r"and its own definition cannot be used: .*'int32 da"),
    ):
        len(log["/probe"])


def test_two_types_of_one_name_in_a_bag(tmp_path):
    path = tmp_path / "two.bag"
    with Writer(path) as writer:
        one = writer.add_connection(
            "/a", "twin_probe_msgs/msg/T", msgdef="int32 a\n", md5sum="5" * 32
        )
        two = writer.add_connection("/b", "twin_probe_msgs/msg/T", msgdef="string b\n",
                                    md5sum="6" * 32)  # fmt: skip
        writer.write(one, 1, b"\4\0\0\0")
        writer.write(two, 2, b"\2\0\0\0hi")
    with open_log(path) as log:
        assert (log["/a"]["a"].tolist(), log["/b"]["b"].tolist()) == ([4], ["hi"])


def test_a_bag_whose_first_record_does_not_count_its_spaces(bag):
    path = bag("/probe", "std_msgs/msg/Int32", "int32 data\n", "7" * 32, b"\6\0\0\0")
    data = path.read_bytes()
    head = 17 + int.from_bytes(data[13:17], "little")
    path.write_bytes(data[:head] + b"    " + data[head + 4 :])
    with open_log(path) as log:
        assert (log.problem, log["/probe"]["data"].tolist()) == ("", [6])
    assert sum(1 for _ in LogWalk(path)) == 1


def test_frame_names():
    assert m.frame_name("/map") == m.frame_name("map") == "map"
    assert m.frame_of(m.PoseStamped(header=m.header(0, "/uav1/odom"))) == "uav1/odom"


_TF_MESSAGE = """geometry_msgs/TransformStamped[] transforms
================================================================================
MSG: geometry_msgs/TransformStamped
Header header
string child_frame_id
geometry_msgs/Transform transform
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
================================================================================
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
================================================================================
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""


@pytest.mark.parametrize("topic", ["tf", "/tf", "tf_static", "/tf_static"])
def test_transforms_of_the_first_tf(bag, topic):
    """Bags of tf hold tf/tfMessage, topics without a leading slash, and frames with one."""
    pose = m.Transform(m.Vector3(2.0, 0.0, 0.0), m.Quaternion(0.0, 0.0, 0.0, 1.0))
    sent = m.TFMessage([m.TransformStamped(m.header(1_000_000_000, "/a"), "/b", pose)])
    data = m.Published(topic, "tf2_msgs/msg/TFMessage", 0, sent).ros1
    md5 = "94810edda583a504dfda3829e70d7eec"  # of tf/tfMessage and of tf2_msgs/TFMessage
    with open_log(bag(topic, "tf/msg/tfMessage", _TF_MESSAGE, md5, data)) as log:
        assert log.tf.lookup("a", "b", [1.0]).position.tolist() == [[2.0, 0.0, 0.0]]
        (found,) = log.messages(topic)
        assert type(found.message) is m.TFMessage
