"""Encodes and parses the frames of the radio network, without sockets.

docs/comms.md defines them. CRC and synchronization are those of `core.framing`.
"""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import NamedTuple

from volery.core.errors import CommsError
from volery.core.framing import CRC_BYTES, Flaw, FrameScanner, crc16, crc_bytes

SYNC = b"\xaaVCM"
VERSION = 1
HEAD_BYTES = 30
PAYLOAD_LIMIT_BYTES = 16 << 10
"""Modelling choice: the message of a packet radio, not a map; larger data is split."""
LONGEST_BYTES = HEAD_BYTES + PAYLOAD_LIMIT_BYTES + CRC_BYTES
"""Max size of a whole frame, bytes."""

_HEAD = struct.Struct("<BBHHHIIq")


class StationFrameKind(IntEnum):
    """Kinds of frames; from 16 on messages between stations."""

    HELLO = 1
    WELCOME = 2
    REFUSAL = 3
    RECEIVED = 4
    SETTLED = 5
    PING = 6
    PONG = 7
    COMMAND = 16
    SENSING = 17


MESSAGES = frozenset({StationFrameKind.COMMAND, StationFrameKind.SENSING})


class StationFrame(NamedTuple):
    """A valid frame; `kind` may be unknown."""

    kind: int
    source: int
    destination: int
    session: int
    sequence: int
    time_ns: int
    payload: bytes
    data: bytes = b""
    """All bytes of the frame, to be forwarded."""


def encode_frame(
    kind: int,
    source: int,
    destination: int,
    session: int = 0,
    sequence: int = 0,
    time_ns: int = 0,
    payload: bytes = b"",
) -> bytes:
    """Returns a whole frame. Raises CommsError if the payload or a number is too large."""
    if len(payload) > PAYLOAD_LIMIT_BYTES:
        raise CommsError(
            f"a payload of {len(payload)} bytes is too long: {PAYLOAD_LIMIT_BYTES} is the limit"
        )
    try:
        head = _HEAD.pack(
            VERSION, kind, source, destination, len(payload), session, sequence, time_ns
        )
    except struct.error as error:
        raise CommsError(f"{source} to {destination}, sequence {sequence}: {error}") from None
    guarded = head + crc_bytes(crc16(head)) + payload
    return SYNC + guarded + crc_bytes(crc16(guarded))


class StationFrameParser(FrameScanner[StationFrame]):
    """Finds frames of the radio network in a stream of bytes."""

    def __init__(self) -> None:
        super().__init__(SYNC, HEAD_BYTES)

    def payload_bytes(self, head: bytes | bytearray) -> int | Flaw:
        """Returns the payload length of a head, within the limit, or the flaw."""
        version, _, _, _, length, _, _, _ = _HEAD.unpack(head)
        if version != VERSION:
            return Flaw.VERSION
        return Flaw.LENGTH if length > PAYLOAD_LIMIT_BYTES else int(length)

    def frame_of(self, view: memoryview) -> StationFrame:
        """Returns the frame of its bytes."""
        data = bytes(view)
        _, kind, source, destination, _, session, sequence, time_ns = _HEAD.unpack_from(
            data, len(SYNC)
        )
        payload = data[HEAD_BYTES:-CRC_BYTES]
        return StationFrame(kind, source, destination, session, sequence, time_ns, payload, data)
