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
