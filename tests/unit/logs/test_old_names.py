"""Names that old tools wrote into logs: types, topics, frames, files."""

import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from volery import open_log
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
