"""CBOR, JSON, images and fragments: golden forms from independent coders."""

from __future__ import annotations

import base64
import io
import json
import math
import struct
from contextlib import suppress

import cbor2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from volery.bridges.rosbridge.cbor_codec import decode_cbor, encode_cbor
from volery.bridges.rosbridge.fragments import MAX_FRAGMENTS, MAX_OPEN, Assembly, split
from volery.bridges.rosbridge.message_encoder import MessageEncoder
from volery.bridges.rosbridge.wire import decode_frame, decode_png, encode_json, encode_png
from volery.core.errors import BridgeError
from volery.graph import messages as m
from volery.graph.codecs.ros1 import ros1_codec

PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**63)
    | st.floats(allow_nan=False)
    | st.text()
    | st.binary(),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(), inner, max_size=5),
    max_leaves=20,
)


@given(PLAIN)
def test_cbor_is_read_by_another_coder_and_read_back(value):
    data = encode_cbor(value)
    assert cbor2.loads(data) == value
    assert decode_cbor(data) == value
    assert decode_cbor(cbor2.dumps(value)) == value


@pytest.mark.parametrize(
    ("value", "golden"),
    [
        ({"op": "x", "n": [0, 23, 24, -1, 256]}, "a2626f706178616e850017181820190100"),
        (1.5, "fb3ff8000000000000"),
        (np.array([1, 2], "<f4"), "d855480000803f00000040"),
        (np.array([1.0], ">f8"), "d85648000000000000f03f"),
        (np.array([-1, 1], np.int16), "d84d44ffff0100"),
        (np.array([7, 8], np.uint8), "420708"),
        (np.array([-1], np.int8), "d84841ff"),
        (np.zeros(0, np.float32), "d85540"),
        (np.array([1], np.uint64), "d847480100000000000000"),
    ],
)
def test_golden_cbor(value, golden):
    assert encode_cbor(value).hex() == golden


@pytest.mark.parametrize(
    ("tag", "form", "values"),
    [
        (64, "2B", (1, 2)),
        (65, ">2H", (1, 300)),
        (66, ">2I", (1, 70000)),
        (69, "<2H", (1, 300)),
        (72, "2b", (-1, 2)),
        (73, ">2h", (-1, 2)),
        (79, "<2q", (-1, 2)),
        (81, ">2f", (1.5, -2.0)),
        (84, "<2e", (1.5, -2.0)),
        (85, "<2f", (1.5, -2.0)),
        (86, "<2d", (1.5, -2.0)),
    ],
)
def test_typed_arrays_of_others_are_read(tag, form, values):
    found = decode_cbor(cbor2.dumps(cbor2.CBORTag(tag, struct.pack(form, *values))))
    assert found.tolist() == list(values)
    assert found.dtype.byteorder in "=|<"


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xff",
        bytes.fromhex("d81c81d81d00"),  # a list that contains itself
        cbor2.dumps(cbor2.CBORTag(35, "(a+)+$")),
        cbor2.dumps(cbor2.CBORTag(4, [10**9, 1])),
        cbor2.dumps(2**200),
        cbor2.dumps(cbor2.CBORTag(85, b"123")),
        cbor2.dumps(cbor2.CBORTag(85, "text")),
        b"\x81" * 100_000 + b"\x00",
        b"\x9b" + b"\x00" * 3 + b"\xff" * 5,
        b"\x5b" + b"\x7f" + b"\xff" * 7,
        b"\xa1\x80\x00",  # a list as a key
    ],
)
def test_cbor_that_is_refused(data):
    with pytest.raises(BridgeError):
        decode_cbor(data)


@given(st.binary(max_size=200))
def test_no_bytes_do_harm(data):
    with suppress(BridgeError):
        assert isinstance(decode_frame(data)["op"], str)


@given(st.text(max_size=200))
def test_no_text_does_harm(text):
    with suppress(BridgeError):
        assert isinstance(decode_frame(text)["op"], str)


@pytest.mark.parametrize("text", ["[" * 100_000, "1" * 10_000, '{"op": 5}', "[]", "nul"])
def test_json_that_is_refused(text):
    with pytest.raises(BridgeError):
        decode_frame(text)


def test_json_of_what_came_as_cbor():
    value = {"op": "x", "a": np.array([1.0, math.nan]), "b": b"\x01", "c": math.inf}
    value["d"] = np.array([1, 2], np.uint8)
    assert json.loads(encode_json(value)) == {
        "op": "x",
        "a": [1.0, None],
        "b": "AQ==",
        "c": None,
        "d": "AQI=",
    }
    with pytest.raises(BridgeError):
        encode_json({"op": object()})
    with pytest.raises(BridgeError):
        encode_cbor({"op": object()})


@pytest.mark.parametrize("length", [1, 2, 3, 30, 1000, 100_001])
def test_images(length):
    text = encode_json({"op": "x", "t": "é" * length})
    operation = json.loads(encode_png(text))
    assert operation["op"] == "png"
    with Image.open(io.BytesIO(base64.b64decode(operation["data"]))) as image:
        assert image.mode == "RGB"
        assert json.loads(image.tobytes().decode()) == json.loads(text)  # newlines pad it
    assert decode_png(operation, 10_000_000) == json.loads(text)


def bomb(size):
    file = io.BytesIO()
    Image.new("RGB", (size, size)).save(file, "png")
    return base64.b64encode(file.getvalue()).decode()


@pytest.mark.parametrize(
    "data",
    [
        5,
        "",
        "%%%",
        base64.b64encode(b"no image").decode(),
        base64.b64encode(b"\x89PNG\r\n\x1a\nshort").decode(),
        bomb(2000),
        json.loads(encode_png(encode_png('{"op":"x"}')))["data"],
        json.loads(encode_png("no json"))["data"],
    ],
)
def test_images_that_are_refused(data):
    with pytest.raises(BridgeError):
        decode_png({"op": "png", "data": data}, 1_000_000)


def test_fragments_in_any_order():
    text = encode_json({"op": "x", "t": "ü" * 100})
    parts = [json.loads(part) for part in split(text, 7, "f")]
    assert all(len(part["data"]) <= 7 for part in parts)
    assembly = Assembly(10_000_000)
    found = [assembly.add(part, 0.0) for part in (*parts[1:], parts[1], parts[0])]
    assert found[-1] == text
    assert found[:-1] == [None] * (len(found) - 1)
    assert assembly.waiting == 0


def test_fragments_are_bounded():
    assembly = Assembly(10_000)
    one = {"op": "fragment", "id": "a", "data": "x", "num": 0, "total": 2}
    for k in range(MAX_OPEN):
        assembly.add(one | {"id": k}, 0.0)
    with pytest.raises(BridgeError, match="are incomplete"):
        assembly.add(one, 0.0)
    assert assembly.add(one, 31.0) is None  # the others have been given up
    assert assembly.waiting == 1
    with pytest.raises(BridgeError, match="bytes"):
        assembly.add(one | {"id": "b", "data": "x" * 20_000}, 31.0)
    with pytest.raises(BridgeError, match="of one message"):
        assembly.add(one | {"id": "b", "total": MAX_FRAGMENTS + 1}, 31.0)
    with pytest.raises(BridgeError, match="differs"):
        assembly.add(one | {"total": 3}, 31.0)
    assert assembly.waiting == 0


@pytest.mark.parametrize(
    "change",
    [{"num": -1}, {"num": 2}, {"num": "0"}, {"total": 0}, {"id": None}, {"data": 5}, {"num": True}],
)
def test_fragments_that_are_refused(change):
    part = {"op": "fragment", "id": "a", "data": "x", "num": 0, "total": 2}
    with pytest.raises(BridgeError):
        Assembly(1000).add(part | change, 0.0)


def scan():
    ranges = np.array([1.5, np.inf, np.nan], np.float32)
    header = m.header(3_000_000_004, "laser")
    empty = np.zeros(0, np.float32)
    message = m.LaserScan(header, -1.0, 1.0, 0.5, 0.0, 0.025, 0.5, 30.0, ranges, empty)
    return m.Published("/scan", "sensor_msgs/msg/LaserScan", 7_000_000_008, message)


def test_a_scan_in_all_forms():
    forms, published = MessageEncoder(), scan()
    text = json.loads(forms.frame(published, "none", "/scan"))
    assert text["topic"] == "/scan"
    assert text["msg"]["ranges"] == [1.5, None, None]
    assert text["msg"]["header"] == {"stamp": {"sec": 3, "nanosec": 4}, "frame_id": "laser"}
    encoded = json.loads(forms.frame(published, "png", "/scan"))
    assert decode_png(encoded, 10_000) == text
    plain = cbor2.loads(forms.frame(published, "cbor", "/scan"), tag_hook=lambda tag, _: tag)
    ranges = plain["msg"]["ranges"]
    assert (ranges.tag, struct.unpack("<3f", ranges.value)[:2]) == (85, (1.5, math.inf))
    raw = cbor2.loads(forms.frame(published, "cbor-raw", "/scan"))
    assert raw["msg"] == {"secs": 7, "nsecs": 8, "bytes": published.cdr}


def test_a_scan_for_ros1_clients():
    forms, published = MessageEncoder("ros1"), scan()
    text = json.loads(forms.frame(published, "none", "scan"))
    stamp = {"secs": 3, "nsecs": 4}
    assert text["msg"]["header"] == {"seq": 0, "stamp": stamp, "frame_id": "laser"}
    raw = cbor2.loads(forms.frame(published, "cbor-raw", "scan"))
    assert raw["msg"]["bytes"] == ros1_codec().encode(published.message, published.msgtype)


def test_a_message_is_encoded_once_for_all():
    forms, published = MessageEncoder(), scan()
    assert forms.frame(published, "cbor", "/scan") is forms.frame(published, "cbor", "/scan")
    for _ in range(200):
        forms.frame(scan(), "cbor", "/scan")
    assert len(forms._cache) <= 64


def test_bytes_in_json_are_base64():
    fields = [m.PointField("x", 0, 7, 1)]
    header = m.header(1, "a")
    data = np.arange(250, dtype=np.uint8)
    cloud = m.PointCloud2(header, 1, 250, fields, False, 1, 250, data, True)
    published = m.Published("/cloud", "sensor_msgs/msg/PointCloud2", 1, cloud)
    found = json.loads(MessageEncoder().frame(published, "none", "/cloud"))["msg"]
    assert base64.b64decode(found["data"]) == data.tobytes()
    assert (found["fields"][0]["name"], found["is_dense"]) == ("x", True)
    assert found == MessageEncoder().plain(cloud, published.msgtype)


OPERATION = {"op": "publish", "topic": "/höhe", "msg": {"data": 1}}


@pytest.mark.parametrize("before", ["", "\n", " \t", "\r\n", "\ufeff"])
@pytest.mark.parametrize("after", ["", "\n", "\0"])
def test_json_in_frames_of_either_kind(before, after):
    text = f"{before}{json.dumps(OPERATION, ensure_ascii=False)}{after}"
    assert decode_frame(text, limited=True) == OPERATION
    assert decode_frame(text.encode(), limited=True) == OPERATION


@pytest.mark.parametrize("tagged", [False, True])
def test_cbor_of_any_length_stays_cbor(tagged):
    for members in (0, 1, 22, 23, 200, 300):
        operation = {"op": "status", **{f"k{k}": k for k in range(members)}}
        data = cbor2.dumps(cbor2.CBORTag(55799, operation) if tagged else operation)
        assert decode_frame(data, limited=True) == operation


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        (b'{"op": "\xff"}', "not readable as JSON"),
        (b'["op"]', "an object with the key"),
        (b"", "CBOR"),
        (bytes.fromhex("10000000026f7000020000007800") + b"\0\0", "BSON is not accepted"),
        (b'{"op": "x", "n": [' + b"1," * 300_000 + b"1]}", "values"),
    ],
)
def test_binary_frames_that_are_no_operation(frame, words):
    with pytest.raises(BridgeError, match=words):
        decode_frame(frame, limited=True)
