"""Tests the ROS 1 wire format, and checked decoding of both wire formats."""

from __future__ import annotations

import struct
import sys
import threading
from typing import Any

import numpy as np
import pytest
from filling import assert_same, filled
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from volery.core.errors import GraphError
from volery.graph import messages as m
from volery.graph.codecs.cdr import decode_cdr, encode_cdr
from volery.graph.codecs.definition_store import DefinitionStore
from volery.graph.codecs.ros1 import Ros1Codec, ros1_codec, ros1_name, ros2_name
from volery.graph.codecs.zero import zero_message
from volery.graph.typestore import typestore

ROS1 = get_typestore(Stores.ROS1_NOETIC)
TYPES = typestore().names()
SHARED = [name for name in TYPES if name in ROS1.fielddefs]
ADDED_BY_ROS2 = frozenset(
    [
        "sensor_msgs/msg/Range.variance",
        "shape_msgs/msg/SolidPrimitive.polygon",
        "visualization_msgs/msg/Marker.texture_resource",
        "visualization_msgs/msg/Marker.texture",
        "visualization_msgs/msg/Marker.uv_coordinates",
        "visualization_msgs/msg/Marker.mesh_file",
        "rosapi_msgs/srv/GetParam_Response.successful",
        "rosapi_msgs/srv/GetParam_Response.reason",
        "rosapi_msgs/srv/SetParam_Response.successful",
        "rosapi_msgs/srv/SetParam_Response.reason",
        "rosapi_msgs/srv/DeleteParam_Response.successful",
        "rosapi_msgs/srv/DeleteParam_Response.reason",
    ]
)
NASTY = [
    "std_msgs/msg/String",
    "std_msgs/msg/UInt8MultiArray",
    "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/LaserScan",
    "tf2_msgs/msg/TFMessage",
    "visualization_msgs/msg/MarkerArray",
    "trajectory_msgs/msg/MultiDOFJointTrajectory",
    "rcl_interfaces/msg/ParameterValue",
    "simulation_interfaces/srv/SpawnEntities_Request",
]


@pytest.fixture(scope="module")
def codec() -> Ros1Codec:
    return ros1_codec()


def scan(count: int = 5) -> Any:
    ranges = np.linspace(0.1, 30.0, count, dtype=np.float32)
    ranges[0] = np.inf
    head = m.header(1_500_000_007, "uav1/laser")
    nothing = np.zeros(0, np.float32)
    return m.LaserScan(head, -2.0, 2.0, 0.5, 0.0, 0.0, 0.5, 30.0, ranges, nothing)


@pytest.mark.parametrize(
    ("name", "md5"),
    [  # as `rosmsg md5` and `rossrv md5` print them
        ("std_msgs/msg/String", "992ce8a1687cec8c8bd883ec73ca41d1"),
        ("std_msgs/msg/Empty", "d41d8cd98f00b204e9800998ecf8427e"),
        ("std_srvs/srv/Empty", "d41d8cd98f00b204e9800998ecf8427e"),
        ("std_srvs/srv/SetBool", "09fb03525b03e7ea1fd3992bafd87e16"),
        ("std_srvs/srv/Trigger", "937c9679a518e3a18d831e57125ea522"),
        ("geometry_msgs/msg/Twist", "9f195f881246fdfa2798d1d3eebca84a"),
        ("sensor_msgs/msg/LaserScan", "90c7ef2dc6895d81024acba2ac42f369"),
        ("tf2_msgs/msg/TFMessage", "94810edda583a504dfda3829e70d7eec"),
        ("builtin_interfaces/msg/Time", "cd7166c74c552c311fbcc2fe5a7bc289"),
    ],
)
def test_known_md5_sums(codec: Ros1Codec, name: str, md5: str) -> None:
    assert codec.md5(name) == md5


@pytest.mark.parametrize("name", [n for n in SHARED if not n.startswith("builtin")])
def test_sums_and_texts_of_shared_types(codec: Ros1Codec, name: str) -> None:
    assert (codec.definition_text(name), codec.md5(name)) == ROS1.generate_msgdef(name)


def test_definition_text_of_a_service(codec: Ros1Codec) -> None:
    text = codec.definition_text("rosapi_msgs/srv/MessageDetails")
    own, rest = text.split("=" * 80 + "\n")
    assert own == "string type\n---\nrosapi/TypeDef[] typedefs\n"
    assert rest.startswith("MSG: rosapi/TypeDef\nstring type\n")
    assert codec.definition_text("std_srvs/srv/Empty") == "---\n"
    assert codec.definition_text("builtin_interfaces/msg/Time") == "time data\n"


def test_moved_package_has_its_old_form(codec: Ros1Codec) -> None:
    text = codec.definition_text("rosapi_msgs/srv/GetParam")
    assert text == "string name\nstring default\n---\nstring value\n"
    request = m.message_type("rosapi_msgs/srv/GetParam_Request")("/a", "b")
    data = codec.encode(request, "rosapi_msgs/srv/GetParam_Request")
    assert data == b"\2\0\0\0/a\1\0\0\0b"
    assert codec.decode(data, "rosapi_msgs/srv/GetParam_Request") == request


def test_bytes_as_ros1_has_them(codec: Ros1Codec) -> None:
    """A header of its own and within lists carries the sequence number."""
    pose = m.Pose(m.Point(1.0, 2.0, 3.0), m.Quaternion(0.0, 0.0, 0.0, 1.0))
    stamped = m.PoseStamped(m.header(1_500_000_007, "map"), pose)
    data = codec.encode(stamped, "geometry_msgs/msg/PoseStamped", seq=9)
    want = struct.pack("<IIII3s7d", 9, 1, 500_000_007, 3, b"map", 1, 2, 3, 0, 0, 0, 1)
    assert data == want
    transform = m.Transform(m.Vector3(0.0, 0.0, 0.0), m.Quaternion(0.0, 0.0, 0.0, 1.0))
    frame = m.TransformStamped(m.header(0, "map"), "odom", transform)
    data = codec.encode(m.TFMessage([frame, frame]), "tf2_msgs/msg/TFMessage", seq=2**32 + 3)
    one = struct.pack("<IIII3sI4s7d", 3, 0, 0, 3, b"map", 4, b"odom", 0, 0, 0, 0, 0, 0, 1)
    assert data == struct.pack("<I", 2) + one + one


@pytest.mark.parametrize("name", SHARED)
def test_ros1_store_reads_our_bytes(codec: Ros1Codec, name: str) -> None:
    """rosbags' own ROS 1 coder, which knows nothing of ours, is the reference."""
    if "Header" in name:
        return
    message = filled(name, np.random.default_rng(3))
    data = codec.encode(message, name, seq=5)
    read = ROS1.deserialize_ros1(data, name)
    assert bytes(ROS1.serialize_ros1(read, name)) == data


@pytest.mark.parametrize("name", TYPES)
def test_round_trips(codec: Ros1Codec, name: str) -> None:
    """All types, those that both generations know and those that only ROS 2 does."""
    for seed in range(3):
        message = filled(name, np.random.default_rng(seed))
        data = codec.encode(message, name, seq=seed)
        back = codec.decode(data, name)
        assert_same(back, message, name, except_for=ADDED_BY_ROS2)
        assert codec.encode(back, name, seq=seed) == data
        cdr = encode_cdr(message, name)
        assert_same(decode_cdr(cdr, name), message, name)
        swapped = typestore().serialize_cdr(message, name, little_endian=sys.byteorder != "little")
        assert_same(decode_cdr(swapped, name), message, name)
        zero = zero_message(name)
        assert_same(decode_cdr(encode_cdr(zero, name), name), zero, name)


def test_added_fields_are_zero(codec: Ros1Codec) -> None:
    message = m.Range(m.header(0, "uav1"), 0, 0.5, 0.5, 8.0, 2.5, 0.25)
    data = codec.encode(message, "sensor_msgs/msg/Range")
    back = codec.decode(data, "sensor_msgs/msg/Range")
    assert (back.range, back.variance) == (2.5, 0.0)


@pytest.mark.parametrize("kind", [bytearray, memoryview, bytes])
def test_arrays_are_owned(codec: Ros1Codec, kind: type) -> None:
    for encode, decode in ((codec.encode, codec.decode), (encode_cdr, decode_cdr)):
        buffer = bytearray(encode(scan(), "sensor_msgs/msg/LaserScan"))
        view = buffer if kind is bytearray else kind(buffer)
        got = decode(view, "sensor_msgs/msg/LaserScan")
        buffer[:] = bytes(len(buffer))
        np.testing.assert_array_equal(got.ranges, scan().ranges)
        with pytest.raises(ValueError, match="read-only"):
            got.ranges[0] = 1.0


def test_short_and_long_input(codec: Ros1Codec) -> None:
    for encode, decode in ((codec.encode, codec.decode), (encode_cdr, decode_cdr)):
        data = encode(scan(), "sensor_msgs/msg/LaserScan")
        for cut in range(len(data)):
            with pytest.raises(GraphError, match="LaserScan"):
                decode(data[:cut], "sensor_msgs/msg/LaserScan")
        with pytest.raises(GraphError, match="were given"):
            decode(data + bytes(4), "sensor_msgs/msg/LaserScan")


def test_lying_lengths(codec: Ros1Codec) -> None:
    huge = b"\xff\xff\xff\xff"
    for name in ("std_msgs/msg/String", "tf2_msgs/msg/TFMessage"):
        with pytest.raises(GraphError):
            codec.decode(huge + bytes(64), name)
        with pytest.raises(GraphError):
            decode_cdr(b"\0\1\0\0" + huge + bytes(64), name)


def test_array_of_messages_without_content(tmp_path: Any) -> None:
    """Such elements take no bytes in ROS 1, so no length of theirs is too long for the data."""
    store = DefinitionStore(get_typestore(Stores.ROS2_JAZZY), "nowhere")
    (tmp_path / "farm" / "msg").mkdir(parents=True)
    (tmp_path / "farm" / "msg" / "Voids.msg").write_text("std_msgs/Empty[] voids\n")
    store.add_folder(tmp_path)
    codec = Ros1Codec(store)
    message = codec.decode(struct.pack("<I", 500), "farm/msg/Voids")
    assert len(message.voids) == 500
    assert codec.encode(message, "farm/msg/Voids") == struct.pack("<I", 500)
    with pytest.raises(GraphError):
        codec.decode(struct.pack("<I", 2**32 - 1), "farm/msg/Voids")


def test_texts_of_other_writers(codec: Ros1Codec) -> None:
    """Latin-1, as programs in C++ write it, in single texts, sequences and nested messages."""
    latin = b"\2\0\0\0\xfcb"
    assert codec.decode(latin, "std_msgs/msg/String", is_tolerant=True).data == "\ufffdb"
    nested = bytes(12) + latin
    assert codec.decode(nested, "std_msgs/msg/Header", is_tolerant=True).frame_id == "\ufffdb"
    for header, order in ((b"\0\1\0\0", "<"), (b"\0\0\0\0", ">")):
        two, three, none = (struct.pack(f"{order}I", length) for length in (2, 3, 0))
        names = header + bytes(8) + none + three + none + two + b"\xe9\0" + b"\0\0" + none * 4
        for data, msgtype, field, value in (
            (header + three + b"\xfcb\0", "std_msgs/msg/String", "data", "\ufffdb"),
            (header + none, "std_msgs/msg/String", "data", ""),
            (header + bytes(8) + none, "std_msgs/msg/Header", "frame_id", ""),
            (names, "sensor_msgs/msg/JointState", "name", ["", "\ufffd", ""]),
        ):
            assert getattr(decode_cdr(data, msgtype, is_tolerant=True), field) == value
            with pytest.raises(GraphError):
                decode_cdr(data, msgtype)


def test_bad_text_and_header(codec: Ros1Codec) -> None:
    with pytest.raises(GraphError):
        codec.decode(b"\1\0\0\0\xff", "std_msgs/msg/String")
    with pytest.raises(GraphError):
        decode_cdr(b"\0\1\0\0\2\0\0\0\xff\0", "std_msgs/msg/String")
    for is_tolerant in (False, True):
        with pytest.raises(GraphError, match="Missing string terminator"):
            decode_cdr(b"\0\1\0\0\2\0\0\0ab", "std_msgs/msg/String", is_tolerant=is_tolerant)
        for data in (b"\5\0\0\0ab", b"\xff\xff\xff\xffab"):
            with pytest.raises(GraphError):
                codec.decode(data, "std_msgs/msg/String", is_tolerant=is_tolerant)
            with pytest.raises(GraphError):
                decode_cdr(b"\0\1\0\0" + data, "std_msgs/msg/String", is_tolerant=is_tolerant)
    with pytest.raises(GraphError, match="not CDR of version 1"):
        decode_cdr(b"\0\7\0\0\2\0\0\0a\0", "std_msgs/msg/String")
    with pytest.raises(GraphError, match="not CDR"):
        decode_cdr(b"", "std_msgs/msg/String")


@pytest.mark.parametrize("name", NASTY)
@settings(max_examples=150)
@given(data=st.binary(max_size=200))
def test_garbage(name: str, data: bytes) -> None:
    for decode, raw in ((ros1_codec().decode, data), (decode_cdr, b"\0\1\0\0" + data)):
        try:
            message = decode(raw, name)
        except GraphError:
            continue
        assert type(message) is m.message_type(name)


@pytest.mark.parametrize("name", NASTY)
@settings(max_examples=100)
@given(st.integers(0, 2**16), st.integers(0, 2**16), st.integers(0, 255), st.booleans())
def test_damaged_messages(name: str, seed: int, where: int, byte: int, big: bool) -> None:
    message = filled(name, np.random.default_rng(seed))
    cdr = bytes(typestore().serialize_cdr(message, name, little_endian=not big))
    for decode, raw in (
        (ros1_codec().decode, ros1_codec().encode(message, name)),
        (decode_cdr, cdr),
    ):
        damaged = bytearray(raw)
        damaged[where % len(damaged)] = byte
        try:
            found = decode(damaged, name)
        except GraphError:
            continue
        assert type(found) is m.message_type(name)


def test_messages_that_do_not_fit(codec: Ros1Codec) -> None:
    bad = [
        (m.Vector3("x", 0.0, 0.0), "geometry_msgs/msg/Vector3"),
        (m.String(3), "std_msgs/msg/String"),
        (m.String("a"), "geometry_msgs/msg/Twist"),
        (m.message_type("std_msgs/msg/UInt8")(300), "std_msgs/msg/UInt8"),
        (m.PoseWithCovariance(zero_message("geometry_msgs/msg/Pose"), np.zeros(3)), None),
    ]
    for message, name in bad:
        for encode in (codec.encode, encode_cdr):
            with pytest.raises(GraphError, match="does not fit"):
                encode(message, name or m.type_name(type(message)))


def test_unknown_types(codec: Ros1Codec) -> None:
    for call in (
        lambda: codec.encode(m.String("a"), "a/msg/B"),
        lambda: codec.decode(b"", "a/msg/B"),
        lambda: codec.md5("a/srv/B"),
        lambda: codec.definition_text("a/srv/B"),
        lambda: decode_cdr(b"", "a/msg/B"),
        lambda: encode_cdr(m.String("a"), "a/msg/B"),
        lambda: zero_message("a/msg/B"),
    ):
        with pytest.raises(GraphError, match="unknown"):
            call()


def test_names() -> None:
    pairs = [
        ("std_msgs/msg/String", "std_msgs/String", "msg"),
        ("std_srvs/srv/SetBool", "std_srvs/SetBool", "srv"),
        ("rosapi_msgs/srv/Topics", "rosapi/Topics", "srv"),
        ("builtin_interfaces/msg/Time", "std_msgs/Time", "msg"),
        (
            "simulation_interfaces/action/SimulateSteps",
            "simulation_interfaces/SimulateSteps",
            "action",
        ),
    ]
    for new, old, kind in pairs:
        assert ros1_name(new) == ros1_name(old) == old
        assert ros2_name(old, kind) == ros2_name(new, kind) == new  # type: ignore[arg-type]
    assert ros1_name("std_srvs/srv/SetBool_Request") == "std_srvs/SetBoolRequest"
    for bad in ("", "String", "a/b/c/d", "std_msgs/", "std_msgs/msg/", "std msgs/String"):
        with pytest.raises(GraphError, match="not the name of a ROS type"):
            ros2_name(bad)
    with pytest.raises(GraphError, match="names a srv, not a msg"):
        ros2_name("std_srvs/srv/SetBool")


def test_threads_share_a_codec() -> None:
    codec = Ros1Codec()
    failures: list[BaseException] = []

    def work(seed: int) -> None:
        try:
            for name in SHARED[seed::2] + SHARED[::-1]:
                message = filled(name, np.random.default_rng(seed))
                codec.decode(codec.encode(message, name), name)
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
