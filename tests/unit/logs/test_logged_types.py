"""A log's own definitions decode it, also where a known type of the same name differs."""

from __future__ import annotations

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from volery.core.errors import RecordingError
from volery.graph.typestore import typestore
from volery.logs import open_log

LINE = "=" * 80 + "\n"
HEADERS = {
    "ros1": f"{LINE}MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n",
    "cdr": f"{LINE}MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
    f"{LINE}MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
}
OLD_STATE = "std_msgs/Header header\nbool connected\nbool armed\nbool guided\nstring mode\n"
STATE, RANGE = "mavros_msgs/msg/State", "sensor_msgs/msg/Range"


@pytest.fixture(params=["ros1", "cdr"])
def logged(request, tmp_path):
    """Returns a function that writes one message to a bag or an MCAP file and opens it."""

    def write(msgtype, definition, nested, values):
        store = get_typestore(Stores.ROS1_NOETIC if request.param == "ros1" else Stores.ROS2_JAZZY)
        for name in {msgtype, *nested}:
            store.fielddefs.pop(name, None)
            store.types.pop(name, None)
        added = {}
        for name, text in {**nested, msgtype: definition}.items():
            added.update(get_types_from_msg(text, name))
        store.register(added)
        message = values(store)
        full = definition + "".join(
            f"{LINE}MSG: {name.replace('/msg/', '/')}\n{text}" for name, text in nested.items()
        )
        full += HEADERS[request.param]
        if request.param == "ros1":
            path = tmp_path / "old.bag"
            with Writer(path) as writer:
                _, md5 = store.generate_msgdef(msgtype, ros_version=1)
                channel = writer.add_connection("/probe", msgtype, msgdef=full, md5sum=md5)
                writer.write(channel, 1, bytes(store.serialize_ros1(message, msgtype)))
        else:
            path = tmp_path / "old.mcap"
            with path.open("wb") as file:
                mcap = McapWriter(file)
                mcap.start()
                schema = mcap.register_schema(msgtype, "ros2msg", full.encode())
                data = bytes(store.serialize_cdr(message, msgtype))
                mcap.add_message(mcap.register_channel("/probe", "cdr", schema), 1, data, 1)
                mcap.finish()
        return open_log(path)

    return write


def header(store):
    stamp = store.types["builtin_interfaces/msg/Time"](3, 4)
    numbers = () if "seq" not in store.types["std_msgs/msg/Header"].__annotations__ else (9,)
    return store.types["std_msgs/msg/Header"](*numbers, stamp, "base_link")


def test_fields_that_later_versions_added(logged):
    log = logged(
        STATE,
        OLD_STATE,
        {},
        lambda store: store.types[STATE](header(store), True, False, True, "MANUAL"),
    )
    data = log["/probe"]
    assert data["mode"].tolist() == ["MANUAL"]
    assert data["header.frame_id"].tolist() == ["base_link"]
    assert [data[name].tolist() for name in ("connected", "armed", "manual_input")] == [
        [True], [False], [False],
    ]  # fmt: skip
    (found,) = log.messages("/probe")
    assert type(found.message) is typestore().types[STATE]


def test_fields_that_later_versions_changed(logged):
    text = "std_msgs/Header header\nuint8 mode\nfloat64 old_field\n"
    log = logged(STATE, text, {}, lambda store: store.types[STATE](header(store), 5, 2.5))
    data = log["/probe"]
    assert data.fields[-2:] == ("mode", "old_field")
    assert (data["mode"].tolist(), data["old_field"].tolist()) == ([5], [2.5])
    assert log.topics["/probe"].msgtype == STATE


def test_a_nested_type_that_differs(logged):
    nested = {
        "nested_probe_msgs/msg/Plain": "int16 count\n",
        "geometry_msgs/msg/Point32": "float64 x\nnested_probe_msgs/Plain plain\n",
    }
    name = "nested_probe_msgs/msg/Whole"

    def values(store):
        plain = store.types["nested_probe_msgs/msg/Plain"](7)
        point = store.types["geometry_msgs/msg/Point32"](1.5, plain)
        return store.types[name]([point], plain)

    text = "geometry_msgs/Point32[] points # as sent\nPlain plain\n"
    (found,) = logged(name, text, nested, values).messages("/probe")
    assert found.message.plain.count == 7
    assert (found.message.points[0].x, found.message.points[0].plain.count) == (1.5, 7)


def test_a_known_type_whose_nested_type_differs(logged):
    name = "geometry_msgs/msg/Polygon"
    nested = {"geometry_msgs/msg/Point32": "float64 x\nfloat64 y\nfloat64 z\n"}

    def values(store):
        point = store.types["geometry_msgs/msg/Point32"]
        return store.types[name]([point(1.1, 2.2, 3.3), point(4.4, 5.5, 6.6)])

    (found,) = logged(name, "geometry_msgs/Point32[] points\n", nested, values).messages("/probe")
    assert [point.z for point in found.message.points] == [3.3, 6.6]


IDL = f"""{LINE}IDL: idl_probe_msgs/msg/Level
// generated from rosidl_adapter/resource/msg.idl.em
#include "std_msgs/msg/Header.idl"

module idl_probe_msgs {{
  module msg {{
    module Level_Constants {{
      const uint8 LOW = 1;
    }};
    typedef float float__2[2];
    @verbatim (language="comment", text=
      "A level." "\\n"
      "With {{ brackets and = in its comment.")
    struct Level {{
      std_msgs::msg::Header header;
      @unit (value="m")
      double value;
      float__2 pair;
      sequence<idl_probe_msgs::msg::Part, 3> parts;
      string<9> Name;
      octet flags;
    }};
  }};
}};
{LINE}IDL: idl_probe_msgs/msg/Part
module idl_probe_msgs {{ module msg {{ struct Part {{ boolean on; }}; }}; }};
"""


def mcap_in_idl(path, name, text, data):
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = writer.register_schema(name, "ros2idl", text.encode())
        writer.add_message(writer.register_channel("/probe", "cdr", schema), 1, data, 1)
        writer.finish()
    return open_log(path)


def test_a_definition_in_idl_is_read(tmp_path):
    name = "idl_probe_msgs/msg/Level"
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg("bool on\n", "idl_probe_msgs/msg/Part"))
    fields = "std_msgs/Header header\nfloat64 value\nfloat32[2] pair\n"
    fields += "idl_probe_msgs/Part[<=3] parts\nstring Name\nbyte flags\n"
    store.register(get_types_from_msg(fields, name))
    part = store.types["idl_probe_msgs/msg/Part"]
    pair = np.array([1.0, 2.0], np.float32)
    message = store.types[name](header(store), 2.5, pair, [part(True), part(False)], "probe", 7)
    data = bytes(store.serialize_cdr(message, name))
    (found,) = mcap_in_idl(tmp_path / "idl.mcap", name, IDL, data).messages("/probe")
    read = found.message
    assert (read.header.frame_id, read.value, read.pair.tolist()) == ("base_link", 2.5, [1.0, 2.0])
    assert ([p.on for p in read.parts], read.Name, read.flags) == ([True, False], "probe", 7)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("module a { module msg { union B { }; }; };", "in IDL is not readable"),
        ("module a {" * 60, "more than 50 brackets"),
        ("@unit " * 3000, "2000 annotations"),
        ("module a { module msg { struct B { double x; }; }; };", "defines others"),
    ],
)
def test_a_definition_in_idl_that_is_not_readable_is_refused(tmp_path, text, words):
    with pytest.raises(RecordingError, match=words):
        mcap_in_idl(tmp_path / "bad.mcap", "idl_bad_msgs/msg/Level", text, bytes(12))["/probe"]["x"]
