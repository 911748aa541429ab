"""Frames of the sensor link: golden bytes, and a parser that nothing upsets."""

from __future__ import annotations

import re
import struct
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from volery.bridges.sensor_link.wire import (
    HEAD_BYTES,
    OTHER_LIMIT_BYTES,
    SYNC,
    SensorLinkFrame,
    SensorLinkKind,
    SensorLinkParser,
    encode_frame,
    encode_head,
)
from volery.core.errors import BridgeError


def slow_crc(data: bytes) -> int:
    """CRC-16/CCITT-FALSE bit by bit, as the catalogue of CRCs defines it."""
    crc = 0xFFFF
    for byte in data:
        for bit in range(7, -1, -1):
            out = (crc >> 15) ^ (byte >> bit & 1)
            crc = (crc << 1 ^ (0x1021 if out else 0)) & 0xFFFF
    return crc


def slow_frame(kind: int, uav: int, sequence: int, stamp_ns: int, payload: bytes) -> bytes:
    """A frame put together field by field."""
    head = bytes([1, kind])
    for number, size in ((uav, 2), (len(payload), 4), (sequence, 4)):
        head += number.to_bytes(size, "little")
    head += stamp_ns.to_bytes(8, "little", signed=True)
    head += slow_crc(head).to_bytes(2, "little")
    body = head + payload
    return bytes([0xAA, 0x56, 0x4C, 0x59]) + body + slow_crc(body).to_bytes(2, "little")


def parse(data: bytes) -> tuple[list[SensorLinkFrame], SensorLinkParser]:
    parser = SensorLinkParser()
    return parser.feed(data) + parser.finish(), parser


def test_the_crc_is_the_one_stated() -> None:
    assert slow_crc(b"123456789") == 0x29B1


def test_golden_frame() -> None:
    frame = encode_frame(SensorLinkKind.NOTICE, 3, 0x01020304, 1_500_000_000, b"hello")
    assert frame == bytes.fromhex(
        "aa564c59"  # sync word
        "01"  # version
        "7f"  # notice
        "0300"  # UAV 3
        "05000000"  # five bytes of payload
        "04030201"  # sequence
        "002f685900000000"  # 1.5 s
        "b19b"  # CRC 0x9BB1 of the head
        "68656c6c6f"  # payload
        "d0ed"  # CRC 0xEDD0 of all
    )
    assert frame == slow_frame(127, 3, 0x01020304, 1_500_000_000, b"hello")


def test_the_page_shows_that_frame() -> None:
    page = Path(__file__).parents[3] / "docs" / "sensor_link.md"
    (shown,) = re.findall(r"^    (aa564c59 [0-9a-f ]+)$", page.read_text(), re.MULTILINE)
    assert bytes.fromhex(shown) == slow_frame(127, 3, 0x01020304, 1_500_000_000, b"hello")


frames = st.builds(
    SensorLinkFrame,
    st.integers(0, 255),
    st.integers(0, 65535),
    st.integers(0, 2**32 - 1),
    st.integers(-(2**63), 2**63 - 1),
    st.binary(max_size=80) | st.just(SYNC * 3),
)


def encoded(frame: SensorLinkFrame) -> bytes:
    return encode_frame(frame.kind, frame.uav, frame.sequence, frame.stamp_ns, frame.payload)


@given(frames)
def test_frames_equal_those_of_the_slow_encoder_and_come_back(frame: SensorLinkFrame) -> None:
    data = encoded(frame)
    assert data == slow_frame(frame.kind, frame.uav, frame.sequence, frame.stamp_ns, frame.payload)
    found, parser = parse(data)
    assert found == [frame]
    assert (parser.frames, parser.corrupt, parser.noise_bytes) == (1, 0, 0)


@given(st.lists(frames, max_size=8), st.data())
def test_however_a_stream_is_cut_the_frames_are_the_same(sent, data) -> None:
    stream = b"".join(map(encoded, sent))
    parser, found = SensorLinkParser(), []
    while stream:
        cut = data.draw(st.integers(1, len(stream)))
        found += parser.feed(stream[:cut])
        stream = stream[cut:]
    assert found == sent
    assert parser.waiting_bytes == 0


@given(st.binary(max_size=400), st.lists(st.integers(0, 400), max_size=6))
def test_random_bytes_are_never_fatal(data: bytes, offsets: list[int]) -> None:
    for offset in offsets:
        data = data[:offset] + SYNC + data[offset:]
    found, parser = parse(data)
    assert found == []
    assert parser.noise_bytes == len(data)


@settings(max_examples=300, derandomize=True)  # a CRC of 16 bits lets one in 65,536 pass
@given(st.lists(frames, min_size=1, max_size=5), st.data())
def test_undamaged_frames_are_found_behind_damaged_ones(sent, data) -> None:
    """Of a few frames, some are hit (a bit flipped, cut short) and noise stands in between."""
    stream, whole = b"", []
    for frame in sent:
        piece = bytearray(encoded(frame))
        harm = data.draw(st.sampled_from(["none", "flip", "cut", "noise"]))
        if harm == "flip":
            bit = data.draw(st.integers(0, 8 * len(piece) - 1))
            piece[bit // 8] ^= 1 << bit % 8
        elif harm == "cut":
            # without its last byte alone, a frame is whole where the next sync word begins with it
            del piece[data.draw(st.integers(0, len(piece) - 2)) :]
        else:
            whole.append(frame)
        if harm == "noise":
            stream += data.draw(st.binary(max_size=30))
        stream += bytes(piece)
    found, parser = parse(stream)
    assert [frame for frame in found if frame in whole] == whole
    assert len(found) == len(whole)
    size = sum(len(encoded(frame)) for frame in found)
    assert parser.noise_bytes == len(stream) - size


def test_every_single_bit_flipped_is_noticed() -> None:
    first = encode_frame(SensorLinkKind.SONAR, 1, 7, 25_000_000, bytes(range(20)))
    second = SensorLinkFrame(SensorLinkKind.IMU, 2, 8, 26_000_000, b"whole")
    for bit in range(8 * len(first)):
        broken = bytearray(first)
        broken[bit // 8] ^= 1 << bit % 8
        assert parse(bytes(broken) + encoded(second))[0] == [second]


def test_a_damaged_length_delays_no_frame() -> None:
    broken = bytearray(encode_frame(SensorLinkKind.SONAR, 1, 7, 0, b"x"))
    broken[10] |= 0x0F  # almost a megabyte
    parser = SensorLinkParser()
    whole = SensorLinkFrame(SensorLinkKind.SONAR, 1, 8, 0, b"y")
    assert parser.feed(bytes(broken) + encoded(whole)) == [whole]
    assert parser.corrupt == 1


def test_a_frame_cut_short_is_given_up_when_the_next_ones_fill_it() -> None:
    cut = encode_frame(SensorLinkKind.SONAR, 1, 7, 0, bytes(100))[:50]
    whole = [SensorLinkFrame(SensorLinkKind.SONAR, 1, k, 0, bytes(50)) for k in range(3)]
    parser = SensorLinkParser()
    assert parser.feed(cut + b"".join(map(encoded, whole))) == whole
    assert parser.corrupt == 1


def test_frames_of_another_version_are_dropped_and_counted() -> None:
    frame = bytearray(encode_frame(SensorLinkKind.SONAR, 1, 7, 0, b"x"))
    frame[4] = 9
    frame[24:26] = slow_crc(frame[4:24]).to_bytes(2, "little")
    found, parser = parse(bytes(frame))
    assert found == []
    assert parser.other_version == 9


def test_what_is_too_long_is_refused_on_both_sides() -> None:
    with pytest.raises(BridgeError, match="limit"):
        encode_head(SensorLinkKind.IMU, 1, 0, 0, OTHER_LIMIT_BYTES + 1)
    parser = SensorLinkParser(limit_bytes=10)
    assert parser.feed(encode_frame(SensorLinkKind.IMU, 1, 0, 0, bytes(11))) == []
    assert parser.corrupt == 1


@pytest.mark.parametrize(("uav", "stamp_ns"), [(65536, 0), (-1, 0), (1, 1 << 63)])
def test_numbers_that_have_no_room(uav: int, stamp_ns: int) -> None:
    with pytest.raises(BridgeError, match="UAV"):
        encode_frame(SensorLinkKind.IMU, uav, 0, stamp_ns, b"")


def test_forged_heads_inside_of_each_other_cost_no_more_than_linear_time() -> None:
    """Each of 38,000 heads claims the rest of a megabyte, and none of the claims is true."""
    heads, size = [], 1_000_000
    for start in range(0, size, HEAD_BYTES):
        heads.append(encode_head(SensorLinkKind.IMU, 1, 0, 0, max(size - start - 28, 0)))
    stream = b"".join(heads)
    began = time.process_time()
    _, parser = parse(stream)
    assert time.process_time() - began < 2.0
    assert parser.corrupt > 5


def test_memory_is_bounded_by_one_frame() -> None:
    parser = SensorLinkParser()
    noise = bytes(100_000)
    for _ in range(100):
        parser.feed(noise)
        assert parser.waiting_bytes < HEAD_BYTES
    assert parser.noise_bytes == 10_000_000


def test_many_small_pieces_of_a_big_frame_take_linear_time() -> None:
    frame = encode_frame(SensorLinkKind.IMAGE, 1, 0, 0, bytes(20_000_000))
    parser, found = SensorLinkParser(), []
    began = time.process_time()
    for start in range(0, len(frame), 4096):
        found += parser.feed(frame[start : start + 4096])
    assert len(found) == 1
    assert time.process_time() - began < 2.0


def test_struct_layout_is_packed() -> None:
    assert struct.calcsize("<4sBBHIIqH") == HEAD_BYTES
