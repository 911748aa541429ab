"""Frames of the radio network: golden bytes, and a parser that nothing upsets."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.comms.addresses import (
    ALL,
    FIRST_GROUND,
    SERVER,
    Identity,
    batch_address,
    is_meant,
)
from volery.comms.control_payloads import (
    Hello,
    Reason,
    Received,
    Refusal,
    Welcome,
    decode_hello,
    decode_received,
    decode_refusal,
    decode_settled,
    decode_welcome,
    encode_hello,
    encode_received,
    encode_refusal,
    encode_settled,
    encode_welcome,
)
from volery.comms.protocol import (
    PAYLOAD_LIMIT_BYTES,
    SYNC,
    StationFrame,
    StationFrameKind,
    StationFrameParser,
    encode_frame,
)
from volery.core.errors import CommsError
from volery.core.framing import Flaw


def slow_crc(data: bytes) -> int:
    """CRC-16/CCITT-FALSE bit by bit, as the catalogue of CRCs defines it."""
    crc = 0xFFFF
    for byte in data:
        for bit in range(7, -1, -1):
            out = (crc >> 15) ^ (byte >> bit & 1)
            crc = (crc << 1 ^ (0x1021 if out else 0)) & 0xFFFF
    return crc


def slow_frame(frame: StationFrame, version: int = 1) -> bytes:
    """A frame put together field by field."""
    head = bytes([version, frame.kind])
    fields = (
        (frame.source, 2),
        (frame.destination, 2),
        (len(frame.payload), 2),
        (frame.session, 4),
        (frame.sequence, 4),
    )
    for number, size in fields:
        head += number.to_bytes(size, "little")
    head += frame.time_ns.to_bytes(8, "little", signed=True)
    body = head + slow_crc(head).to_bytes(2, "little") + frame.payload
    return b"\xaa\x56\x43\x4d" + body + slow_crc(body).to_bytes(2, "little")


def encoded(frame: StationFrame) -> bytes:
    return encode_frame(*frame[:-1])


def plain(found: list[StationFrame]) -> list[StationFrame]:
    return [frame._replace(data=b"") for frame in found]


u16, u32 = st.integers(0, 0xFFFF), st.integers(0, 2**32 - 1)
frames = st.tuples(
    st.integers(0, 255),
    u16,
    u16,
    u32,
    u32,
    st.integers(-(2**63), 2**63 - 1),
    st.binary(max_size=80) | st.just(SYNC * 3),
).map(lambda fields: StationFrame(*fields))


def test_golden_frame() -> None:
    frame = StationFrame(StationFrameKind.COMMAND, 5, 6, 0x0A0B0C0D, 2, 1_500_000_000, b"hello")
    data = encoded(frame)
    assert data[:4].hex() == "aa56434d"
    assert data[4:28].hex() == "01100500060005000d0c0b0a02000000002f685900000000"
    assert data == slow_frame(frame)
    assert len(data) == 30 + 5 + 2
    page = Path(__file__).parents[3] / "docs" / "comms.md"
    (shown,) = re.findall(r"^    (aa56434d [0-9a-f ]+)$", page.read_text(), re.MULTILINE)
    assert bytes.fromhex(shown) == data


@given(frames)
def test_frames_equal_those_of_the_slow_encoder_and_come_back(frame: StationFrame) -> None:
    data = encoded(frame)
    assert data == slow_frame(frame)
    (found,) = StationFrameParser().feed(data)
    assert found == frame._replace(data=data)


@given(st.lists(frames, max_size=8), st.data())
def test_however_a_stream_is_cut_the_frames_are_the_same(sent, data) -> None:
    stream = b"".join(map(encoded, sent))
    parser, found = StationFrameParser(), []
    while stream:
        cut = data.draw(st.integers(1, len(stream)))
        found += parser.feed(stream[:cut])
        stream = stream[cut:]
    assert plain(found) == sent
    assert parser.waiting_bytes == 0


@given(st.lists(frames, min_size=1, max_size=4), st.binary(max_size=30), st.data())
def test_undamaged_frames_are_found_behind_a_damaged_one(sent, noise, data) -> None:
    broken = bytearray(encoded(sent[0]))
    bit = data.draw(st.integers(0, 8 * len(broken) - 1))
    broken[bit // 8] ^= 1 << bit % 8
    parser = StationFrameParser()
    found = parser.feed(noise + bytes(broken) + b"".join(map(encoded, sent[1:]))) + parser.finish()
    assert plain(found) == sent[1:]


def test_flaws_are_distinguished() -> None:
    frame = StationFrame(StationFrameKind.SENSING, 1, 2, 3, 4, 5, bytes(range(20)))
    whole = encoded(frame)
    head, body = bytearray(whole), bytearray(whole)
    head[8] ^= 1
    body[35] ^= 1
    long = StationFrame(StationFrameKind.SENSING, 1, 2, 3, 4, 5, bytes(PAYLOAD_LIMIT_BYTES + 1))
    parser = StationFrameParser()
    stream = b"".join((head, body, slow_frame(frame, 2), slow_frame(long), whole, whole[:-1]))
    found = parser.feed(stream) + parser.finish()
    assert plain(found) == [frame]
    assert parser.flaws == {
        Flaw.HEAD: 1,
        Flaw.BODY: 1,
        Flaw.VERSION: 1,
        Flaw.LENGTH: 1,
        Flaw.CUT: 1,
    }
    assert parser.noise_bytes == len(stream) - len(whole)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(CommsError, match="limit"):
        encode_frame(StationFrameKind.COMMAND, 1, 2, payload=bytes(PAYLOAD_LIMIT_BYTES + 1))
    with pytest.raises(CommsError, match="70000"):
        encode_frame(StationFrameKind.COMMAND, 70_000, 2)


@given(st.text(max_size=60), st.text(max_size=60), u16, u16, u16)
def test_hello_comes_back(name: str, token: str, batch: int, plane: int, planes: int) -> None:
    hello = Hello(batch, plane, planes, name, token)
    assert decode_hello(encode_hello(hello)) == hello


@given(st.lists(u32, max_size=20), u32, u32)
def test_other_bodies_come_back(numbers: list[int], boot: int, last: int) -> None:
    assert decode_settled(encode_settled(numbers)) == tuple(numbers)
    welcome = Welcome(boot, last, tuple(numbers))
    assert decode_welcome(encode_welcome(welcome)) == welcome
    entries = [Received(n & 0xFFFF, n, last) for n in numbers]
    assert list(decode_received(encode_received(entries))) == entries
    refusal = Refusal(Reason.FULL, last, "too much ⚠")
    assert decode_refusal(encode_refusal(refusal)) == refusal


@given(st.binary(max_size=60))
def test_bodies_of_random_bytes_are_read_or_refused(data: bytes) -> None:
    for decode in (decode_hello, decode_welcome, decode_refusal, decode_settled):
        try:
            decode(data)
        except CommsError:
            continue
    try:
        list(decode_received(data))
    except CommsError:
        assert len(data) % 10


@given(st.integers(1, 16), st.data())
def test_linear_ids(planes: int, data) -> None:
    batch = data.draw(st.integers(0, min((FIRST_GROUND - 1) // planes - 1, 0x3FFE)))
    plane = data.draw(st.integers(0, planes - 1))
    address = Identity(batch, plane).address(planes)
    assert address == planes * batch + plane
    assert Identity.of(address, planes) == Identity(batch, plane)
    assert is_meant(address, batch_address(batch), planes)
    assert not is_meant(address, batch_address(batch + 1), planes)
    assert is_meant(address, ALL, planes)
    assert is_meant(address, address, planes)


def test_identities_that_cannot_be() -> None:
    with pytest.raises(CommsError, match="planes 0 to 3"):
        Identity(0, 4).address()
    with pytest.raises(CommsError, match="no batch"):
        Identity(FIRST_GROUND, 0).address()
    with pytest.raises(CommsError, match="not a station"):
        Identity.of(SERVER)
    assert Identity.of(Identity.ground(3).address()) == Identity.ground(3)
    assert not is_meant(Identity.ground().address(), batch_address(FIRST_GROUND // 4))
