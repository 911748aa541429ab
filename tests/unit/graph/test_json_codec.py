"""Tests messages as plain JSON values, in both directions, and the rejection of invalid values."""

from __future__ import annotations

import base64
import json
import math
from typing import Any

import numpy as np
import pytest
from filling import assert_same, filled
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.core.errors import GraphError
from volery.graph import messages as m
from volery.graph.codecs.json_codec import JsonCodec
from volery.graph.codecs.json_decoding import decode_plain
from volery.graph.codecs.zero import zero_message
from volery.graph.typestore import typestore

TYPES = typestore().names()
TWIST = "geometry_msgs/msg/Twist"
SCAN = "sensor_msgs/msg/LaserScan"


def as_numpy(values: np.ndarray, base: str) -> Any:
    assert values.dtype.newbyteorder("<") == values.dtype
    return values.tobytes() if base == "uint8" else values


@pytest.mark.parametrize("name", TYPES)
def test_round_trips(name: str) -> None:
    """Through JSON text, with either generation's names, and with arrays kept as arrays."""
    for seed in range(3):
        message = filled(name, np.random.default_rng(seed))
        plain = JsonCodec().encode(message, name)
        text = json.dumps(plain, allow_nan=False)
        assert_same(decode_plain(json.loads(text), name), message, name)
        form = JsonCodec(arrays=as_numpy, non_finite_as_null=False)
        assert_same(form.decode(form.encode(message, name), name), message, name)
        zero = zero_message(name)
        assert_same(decode_plain({}, name), zero, name)


@pytest.mark.parametrize(
    "name",
    ["sensor_msgs/msg/CameraInfo", "tf2_msgs/msg/TFMessage", "rosapi_msgs/srv/GetParam_Request"],
)
def test_ros1_names_are_read(name: str) -> None:
    message = filled(name, np.random.default_rng(1))
    plain = JsonCodec(ros1_names=True).encode(message, name)
    assert_same(decode_plain(json.loads(json.dumps(plain)), name), message, name)


def test_twist() -> None:
    twist = m.Twist(m.Vector3(np.float32(1.5), 2, 3.0), m.Vector3(0.0, math.nan, -math.inf))
    plain = JsonCodec().encode(twist, TWIST)
    assert plain == {
        "linear": {"x": 1.5, "y": 2.0, "z": 3.0},
        "angular": {"x": 0.0, "y": None, "z": None},
    }
    assert type(plain["linear"]["x"]) is float
    kept = JsonCodec(non_finite_as_null=False).encode(twist, TWIST)
    assert kept["angular"]["z"] == -math.inf
    assert math.isnan(decode_plain(plain, TWIST).angular.y)


def test_arrays() -> None:
    form = JsonCodec()
    image = zero_message("sensor_msgs/msg/Image")
    image.data = np.arange(5, dtype=np.uint8)
    plain = form.encode(image, "sensor_msgs/msg/Image")
    assert plain["data"] == base64.b64encode(bytes(range(5))).decode()
    grid = zero_message("octomap_msgs/msg/Octomap")
    grid.data = np.array([-1, 2], np.int8)
    assert form.encode(grid, "octomap_msgs/msg/Octomap")["data"] == [-1, 2]
    scan = zero_message(SCAN)
    scan.ranges = np.array([1.5, np.nan, np.inf], np.float32)
    assert form.encode(scan, SCAN)["ranges"] == [1.5, None, None]
    kept = JsonCodec(non_finite_as_null=False).encode(scan, SCAN)["ranges"]
    assert kept[2] == math.inf
    uuid = form.encode(
        zero_message("unique_identifier_msgs/msg/UUID"), "unique_identifier_msgs/msg/UUID"
    )
    assert uuid == {"uuid": base64.b64encode(bytes(16)).decode()}


def test_bytes_are_read_in_every_form() -> None:
    for given_ in (
        [1, 2, 255],
        "AQL/",
        "AQ\r\nL/\n",
        b"\1\2\xff",
        np.array([1, 2, 255]),
        np.uint8([1, 2, 255]),
    ):
        got = decode_plain({"data": given_}, "sensor_msgs/msg/Image").data
        assert got.dtype == np.uint8
        assert got.tolist() == [1, 2, 255]
        assert not got.flags.writeable


def test_floats_by_name() -> None:
    """As JSON writers of .NET have them; other texts are no numbers."""
    ranges = decode_plain({"ranges": ["NaN", "Infinity", "-Infinity", 1]}, SCAN).ranges
    np.testing.assert_array_equal(ranges, [np.nan, np.inf, -np.inf, 1.0])
    assert decode_plain({"data": "-Infinity"}, "std_msgs/msg/Float64").data == -np.inf
    for text in ("nan", "inf", "1.5"):
        with pytest.raises(GraphError, match="must be a number"):
            decode_plain({"data": text}, "std_msgs/msg/Float64")


def test_arrays_for_cbor() -> None:
    seen = []

    def hook(values: np.ndarray, base: str) -> str:
        seen.append((values.dtype.str, base))
        return "tagged"

    scan = zero_message(SCAN)
    scan.ranges = np.array([1.0, np.inf], ">f4")
    assert JsonCodec(arrays=hook).encode(scan, SCAN)["ranges"] == "tagged"
    assert seen[0] == ("<f4", "float32")
    big_endian = decode_plain({"ranges": np.array([1.0, 2.0], ">f4")}, SCAN).ranges
    assert big_endian.dtype == np.float32
    assert big_endian.tolist() == [1.0, 2.0]


def test_given_arrays_are_copied() -> None:
    values = np.array([1.0, 2.0], np.float32)
    got = decode_plain({"ranges": values}, SCAN).ranges
    values[0] = 9.0
    assert got.tolist() == [1.0, 2.0]


def test_ros1_names() -> None:
    form = JsonCodec(ros1_names=True)
    info = form.encode(zero_message("sensor_msgs/msg/CameraInfo"), "sensor_msgs/msg/CameraInfo")
    assert {"D", "K", "R", "P"} <= info.keys()
    assert not {"d", "k", "r", "p"} & info.keys()
    assert info["header"] == {"seq": 0, "stamp": {"secs": 0, "nsecs": 0}, "frame_id": ""}
    text = form.encode(zero_message("sensor_msgs/msg/Range"), "sensor_msgs/msg/Range")
    assert "variance" not in text


def test_defaults() -> None:
    """Fields left out are zero, unless the definition says otherwise."""
    twist = decode_plain({"linear": {"x": 1}}, TWIST)
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (1.0, 0.0, 0.0)
    assert decode_plain({}, "simulation_interfaces/srv/StepSimulation_Request").steps == 1
    assert decode_plain({}, "geometry_msgs/msg/PoseWithCovariance").covariance.shape == (36,)


def test_whole_floats_are_integers() -> None:
    assert decode_plain({"data": 5.0}, "std_msgs/msg/Int8").data == 5
    array = decode_plain({"data": [1, 2.0]}, "std_msgs/msg/Int64MultiArray").data
    assert array.tolist() == [1, 2]
    integers = decode_plain({"data": [2**64 - 1, 0]}, "std_msgs/msg/UInt64MultiArray").data
    assert integers.tolist() == [2**64 - 1, 0]


REFUSED: list[tuple[str, Any, str]] = [
    (TWIST, {"linear": {"x": "abc"}}, "linear.x must be a number, not 'abc'"),
    (TWIST, {"linear": {"x": True}}, "linear.x must be a number, not true"),
    (TWIST, {"linear": {"w": 1}}, "linear.w is not a field (fields: x, y, z)"),
    (TWIST, {"linear": {"x": 10**400}}, "linear.x does not fit float64: a number of many digits"),
    (TWIST, {"linear": 3}, "linear must be an object, not 3"),
    (TWIST, {"linear": None}, "linear must be an object, not null"),
    (TWIST, [], f"a {TWIST} must be an object, not a list"),
    (TWIST, {5: 1}, "5 is not a field"),
    ("tf2_msgs/msg/TFMessage", {"transforms": {}}, "transforms must be a list, not an object"),
    (
        "tf2_msgs/msg/TFMessage",
        {"transforms": [{}, {"header": {"stamp": {"sec": 2**31}}}]},
        "transforms[1].header.stamp.sec must be -2147483648 to 2147483647, not 2147483648",
    ),
    (
        "std_msgs/msg/Header",
        {"stamp": {"sec": 1, "secs": 1}},
        "stamp.secs is also given as 'sec'",
    ),
    ("std_msgs/msg/Bool", {"data": 1}, "data must be true or false, not 1"),
    ("std_msgs/msg/String", {"data": 1}, "data must be a string, not 1"),
    ("std_msgs/msg/String", {"data": "\ud800"}, "data contains half a surrogate pair"),
    ("std_msgs/msg/Int8", {"data": 1.5}, "data must be an integer, not 1.5"),
    ("std_msgs/msg/Int8", {"data": math.nan}, "data must be an integer, not nan"),
    ("std_msgs/msg/Int8", {"data": True}, "data must be an integer, not true"),
    ("std_msgs/msg/UInt64", {"data": -1}, "data must be 0 to 18446744073709551615, not -1"),
    ("std_msgs/msg/Float32", {"data": 1e39}, "data does not fit float32: 1e+39"),
    (SCAN, {"ranges": [1, "a"]}, "ranges[1] must be a number, not 'a'"),
    (SCAN, {"ranges": [1.0, True]}, "ranges[1] must be a number, not true"),
    (SCAN, {"ranges": [1.0, 1e39]}, "ranges[1] does not fit float32: 1e+39"),
    (SCAN, {"ranges": [1.0, 10**400]}, "ranges[1] does not fit float64"),
    (SCAN, {"ranges": [[1.0]]}, "ranges[0] must be a number, not a list"),
    (SCAN, {"ranges": "AAAA"}, "ranges must be a list, not 'AAAA'"),
    (SCAN, {"ranges": np.zeros((2, 2))}, "ranges must be a list of numbers, not an array of"),
    ("sensor_msgs/msg/Image", {"data": "a*"}, "data must be base64 text (RFC 4648) or a list"),
    ("sensor_msgs/msg/Image", {"data": "grün"}, "data must be base64 text (RFC 4648) or a list"),
    ("sensor_msgs/msg/Image", {"data": 1}, "data must be a list or base64 text, not 1"),
    ("sensor_msgs/msg/Image", {"data": [0, 256]}, "data[1] must be 0 to 255, not 256"),
    ("sensor_msgs/msg/Image", {"data": np.array([-1])}, "data[0] must be 0 to 255, not -1"),
    (
        "geometry_msgs/msg/PoseWithCovariance",
        {"covariance": [1.0]},
        "covariance must have 36 elements, not 1",
    ),
    ("unique_identifier_msgs/msg/UUID", {"uuid": "AAAA"}, "uuid must have 16 elements, not 3"),
    (
        "shape_msgs/msg/SolidPrimitive",
        {"dimensions": [1.0] * 4},
        "dimensions must have at most 3 elements, not 4",
    ),
    ("sensor_msgs/msg/JointState", {"name": ["a", 1]}, "name[1] must be a string, not 1"),
    ("a/msg/B", {}, "unknown message type 'a/msg/B'"),
]


@pytest.mark.parametrize(("name", "plain", "text"), REFUSED, ids=[text for *_, text in REFUSED])
def test_refusals_name_the_path(name: str, plain: Any, text: str) -> None:
    with pytest.raises(GraphError) as error:
        decode_plain(plain, name)
    assert text in str(error.value)
    assert len(str(error.value)) < 300


def test_messages_that_do_not_fit() -> None:
    with pytest.raises(GraphError, match="does not fit geometry_msgs/msg/Twist"):
        JsonCodec().encode(m.String("a"), TWIST)
    with pytest.raises(GraphError, match="unknown message type"):
        JsonCodec().encode(m.String("a"), "a/msg/B")


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(
            st.sampled_from(["header", "stamp", "sec", "data", "x", "linear", "layout", "dim"]),
            inner,
            max_size=4,
        )
    ),
    max_leaves=12,
)


@pytest.mark.parametrize(
    "name",
    [
        TWIST,
        "std_msgs/msg/Header",
        "std_msgs/msg/UInt8MultiArray",
        "std_msgs/msg/Float32MultiArray",
        "std_msgs/msg/Int16MultiArray",
        "sensor_msgs/msg/Image",
    ],
)
@settings(max_examples=150)
@given(plain=json_values)
def test_anything_is_read_or_refused(name: str, plain: Any) -> None:
    """What is read can be sent: it fits CDR."""
    try:
        message = decode_plain(plain, name)
    except GraphError:
        return
    sent = bytes(typestore().serialize_cdr(message, name))
    received = typestore().deserialize_cdr(sent, name)
    assert bytes(typestore().serialize_cdr(received, name)) == sent
