"""The wire format of ROS-TCP: golden bytes, an independent encoder, cuts anywhere, lies."""

from __future__ import annotations

import contextlib
import itertools
import json
import re
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.wire import RosTcpFrame, RosTcpFrameParser
from volery.core.errors import BridgeError


def slow_number(value):
    return bytes((value >> shift) & 0xFF for shift in (0, 8, 16, 24))


def slow_frame(destination, payload):
    name = destination.encode("utf-8")
    out = bytearray()
    for part in (name, payload):
        out += slow_number(len(part))
        for byte in part:
            out.append(byte)
    return bytes(out)


def as_bytes(frames):
    return [(frame.destination, bytes(frame.payload)) for frame in frames]


GOLDEN = [
    ("/t", b"\x01\x02", "02000000 2f74 02000000 0102"),
    ("/ü", b"", "03000000 2fc3bc 00000000"),
    ("__topic_list", b"{}", "0c000000 5f5f746f7069635f6c697374 02000000 7b7d"),
]


@pytest.mark.parametrize(("destination", "payload", "text"), GOLDEN)
def test_golden_bytes(destination, payload, text):
    data = bytes.fromhex(text)
    assert ros_tcp.frame(destination, payload) == data == slow_frame(destination, payload)
    assert as_bytes(RosTcpFrameParser().feed(data)) == [(destination, payload)]


def test_the_handshake_as_unitys_endpoint_writes_it():
    """Captured from ROS-TCP-Endpoint 0.7.0 (ROS 1)."""
    text = b'{"version": "v0.7.0", "metadata": "{\\"protocol\\": \\"ROS1\\"}"}'
    assert ros_tcp.handshake("ros1") == slow_frame("__handshake", text)
    assert ros_tcp.read_handshake(ros_tcp.read_fields(text)) == "ros1"
    assert ros_tcp.read_handshake(ros_tcp.read_fields(text.replace(b"S1", b"S2"))) == "ros2"


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("publish", {"topic": "/a", "message_name": "a/B", "queue_size": 10, "latch": False}),
        ("subscribe", {"topic": "/ü", "message_name": "a/B"}),
        ("ros_service", {"topic": "/a", "message_name": "a/B"}),
        ("unity_service", {"topic": "/a", "message_name": "a/B"}),
        ("request", {"srv_id": 101}),
        ("response", {"srv_id": 1001}),
        ("topic_list", {"topics": ["/a"], "types": ["a/B"]}),
        ("error", {"text": 'with "quotes" and ✓'}),
        ("remove_subscriber", {"topic": "/a"}),
    ],
)
@pytest.mark.parametrize("nul", [False, True])
def test_commands(name, fields, nul):
    data = ros_tcp.command(name, nul=nul, **fields)
    assert data == slow_frame(f"__{name}", json.dumps(fields).encode() + b"\0" * nul)
    (frame,) = RosTcpFrameParser().feed(data)
    assert ros_tcp.read_fields(frame.payload) == fields


def test_keepalives_are_counted_and_skipped():
    parser = RosTcpFrameParser()
    data = bytes(8) + slow_frame("/a", b"x") + bytes(16)
    assert as_bytes(parser.feed(data)) == [("/a", b"x")]
    assert parser.keepalives == 3


def test_a_nul_behind_a_destination_is_none_of_it():
    (frame,) = RosTcpFrameParser().feed(slow_frame("/a\0", b""))
    assert frame == RosTcpFrame("/a", b"")


@pytest.mark.parametrize(
    ("payload", "words"),
    [
        (b"{", "invalid JSON"),
        (b"3", "no JSON object"),
        (b"\xff", "invalid JSON"),
        (b"[" * 100_000, "invalid JSON"),
        (b"9" * 10_000, "invalid JSON"),
        (b" " * (2 << 20), "bytes of JSON"),
    ],
)
def test_bad_json_is_an_error_value(payload, words):
    with pytest.raises(BridgeError, match=words):
        ros_tcp.read_fields(payload)


@pytest.mark.parametrize("payload", [b"", b"\0", b"{}", b"{}\0"])
def test_no_fields(payload):
    assert ros_tcp.read_fields(payload) == {}


@pytest.mark.parametrize("value", [None, "", 3, ["x"]])
def test_a_text_must_be_one(value):
    with pytest.raises(BridgeError, match="'topic'"):
        ros_tcp.text_field({"topic": value}, "topic")


@pytest.mark.parametrize("value", [None, "1", 1.0, True])
def test_a_number_must_be_one(value):
    with pytest.raises(BridgeError, match="'srv_id'"):
        ros_tcp.number_field({"srv_id": value}, "srv_id")


# ------------------------------------------------------------------------------------- streams

frames = st.lists(
    st.tuples(
        st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=30),
        st.one_of(
            st.binary(max_size=60),
            st.sampled_from([5_000, 16_384, 16_385, 65_536, 200_000]).map(bytes),
        ),
    ),
    max_size=8,
)


@settings(max_examples=150)
@given(frames, st.lists(st.integers(1, 70_000), min_size=1, max_size=20))
def test_frames_come_whole_wherever_the_stream_is_cut(wanted, cuts):
    data = b"".join(ros_tcp.frame(*frame) for frame in wanted)
    parser, found, start = RosTcpFrameParser(), [], 0
    for cut in itertools.chain(
        itertools.islice(itertools.cycle(cuts), 3000), itertools.repeat(70_000)
    ):
        if start >= len(data):
            break
        found += parser.feed(data[start : start + cut])
        start += cut
    assert as_bytes(found) == [frame for frame in wanted if frame != ("", b"")]


@settings(max_examples=80)
@given(frames)
def test_frames_come_whole_byte_by_byte(wanted):
    wanted = [(name, payload[:3000]) for name, payload in wanted if name]
    data = b"".join(ros_tcp.frame(*frame) for frame in wanted)
    parser, found = RosTcpFrameParser(), []
    for k in range(len(data)):
        found += parser.feed(data[k : k + 1])
    assert as_bytes(found) == wanted


@settings(max_examples=300)
@given(st.lists(st.binary(max_size=400), max_size=20))
def test_noise_is_frames_or_an_error(pieces):
    parser = RosTcpFrameParser(max_payload=1000, max_destination=100)
    with contextlib.suppress(BridgeError):
        for piece in pieces:
            for frame in parser.feed(piece):
                assert len(frame.payload) <= 1000
                assert len(frame.destination) <= 100


def test_frames_handed_out_are_not_written_to_again():
    parser = RosTcpFrameParser()
    first = parser.feed(slow_frame("/a", b"x" * 100))
    large = parser.feed(ros_tcp.frame("/b", b"y" * 100_000))
    for _ in range(3):
        parser.feed(ros_tcp.frame("/c", b"z" * 100_000))
    assert bytes(first[0].payload) == b"x" * 100
    assert bytes(large[0].payload) == b"y" * 100_000
    assert memoryview(large[0].payload).readonly


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (slow_number(4097), "a destination of 4097 bytes, over 4096"),
        (slow_number(2) + b"/a" + slow_number((64 << 20) + 1), "'/a' claims a payload"),
        (b"\xff" * 8, "destination of 4294967295"),
    ],
)
def test_frames_over_the_limits_are_refused(data, words):
    with pytest.raises(BridgeError, match=words):
        RosTcpFrameParser().feed(data)


def test_frames_at_the_limits_pass():
    parser = RosTcpFrameParser(max_payload=100_000)
    (frame,) = parser.feed(ros_tcp.frame("d" * 4096, bytes(100_000)))
    assert (len(frame.destination), len(frame.payload)) == (4096, 100_000)


def test_claims_cost_no_memory():
    """A hundred peers announce 64 MiB each and send nothing of it."""
    parsers = [RosTcpFrameParser() for _ in range(100)]
    tracemalloc.start()
    try:
        before = payload_bytes()
        for parser in parsers:
            parser.feed(slow_number(2) + b"/a" + slow_number(64 << 20) + bytes(20))
        assert payload_bytes() - before < 32 << 20
    finally:
        tracemalloc.stop()


def test_large_payloads_need_no_huge_pages():
    """The system compacts memory for each of them, and no other client is served meanwhile."""
    (frame,) = RosTcpFrameParser().feed(ros_tcp.frame("/a", bytes(range(256)) * (32 << 12)))
    assert huge_page_bytes(frame.payload) == 0
    assert bytes(frame.payload[-256:]) == bytes(range(256))


def huge_page_bytes(memory):
    """Returns the bytes of huge pages in the mapping that holds the middle of `memory`."""
    address = np.frombuffer(memory, np.uint8).ctypes.data + len(memory) // 2
    inside = False
    for line in Path("/proc/self/smaps").read_text().splitlines():
        if bounds := re.match("([0-9a-f]+)-([0-9a-f]+) ", line):
            inside = int(bounds[1], 16) <= address < int(bounds[2], 16)
        elif inside and line.startswith("AnonHugePages:"):
            return 1024 * int(line.split()[1])
    raise AssertionError("no mapping holds the memory")


def payload_bytes():
    """Returns the bytes of Python's allocators, and what is in use of mappings for payloads."""
    inside, used = False, 0
    for line in Path("/proc/self/smaps").read_text().splitlines():
        if re.match("[0-9a-f]+-[0-9a-f]+ ", line):
            inside = "/dev/zero" in line
        elif inside and line.startswith("Rss:"):
            used += 1024 * int(line.split()[1])
    return used + tracemalloc.get_traced_memory()[0]


def test_work_is_linear_in_bytes():
    def cut_in_pieces(size):
        data = memoryview(ros_tcp.frame("/a", bytes(size)))
        parser, start = RosTcpFrameParser(), time.thread_time()
        for k in range(0, len(data), 1024):
            parser.feed(data[k : k + 1024])
        return time.thread_time() - start

    cut_in_pieces(1 << 20)
    assert min(cut_in_pieces(16 << 20) for _ in range(2)) < 64 * max(cut_in_pieces(1 << 20), 0.001)
