"""The sensor link's frames: bytes to frames and back, without any socket.

The environment (the simulation) listens, the ROS side connects; both send frames of one form. All
numbers are little-endian and packed without padding:

| offset | bytes | type | field |
|---|---|---|---|
| 0 | 4 | | sync word `AA 56 4C 59` |
| 4 | 1 | u8 | version of the protocol, 1 |
| 5 | 1 | u8 | type of the payload, see `Kind` |
| 6 | 2 | u16 | number of the UAV, from 1; 0: none |
| 8 | 4 | u32 | n, bytes of payload, at most `limit_of(kind)` |
| 12 | 4 | u32 | sequence: one more with each frame of this type, UAV and sensor, modulo 2**32 |
| 16 | 8 | i64 | stamp of the message, ns of simulated time |
| 24 | 2 | u16 | CRC of bytes 4 to 23: a damaged length is noticed before anyone waits for it |
| 26 | n | | payload, see `payloads` |
| 26 + n | 2 | u16 | CRC of all bytes from 4 to 25 + n |

The CRC is CRC-16/CCITT-FALSE: polynomial x^16 + x^12 + x^5 + 1 (0x1021), initial value 0xFFFF,
neither input nor output reflected, nothing xored at the end; of the ASCII text `123456789` it is
0x29B1. A gap in the sequence tells how many frames a reader was too slow for.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from dataclasses import dataclass
from enum import IntEnum

from volery.core.errors import BridgeError

SYNC = b"\xaaVLY"
VERSION = 1
CRC_START = 0xFFFF
HEAD_BYTES = 26
TAIL_BYTES = 2
IMAGE_LIMIT_BYTES = 64 << 20
"""Enough for an image of 4096 x 4096 pixels with 4 bytes each."""
OTHER_LIMIT_BYTES = 1 << 20

_HEAD = struct.Struct("<BBHIIq")
_CRC = struct.Struct("<H")

_SPARE_WORK_BYTES = 4 << 20
_MOST_SPARED_BYTES = 256 << 20
_WORK_PER_BYTE = 4
"""Bytes checked at most for each byte received, beside the spare ones.

Frames inside of damaged frames are looked for by checking the same bytes again. Only a peer who
nests forged heads gets beyond this; damaged frames of his are then passed over whole.
"""


class Kind(IntEnum):
    """Types of payload; below 128 from the environment, from there on to it."""

    LASER_SCAN = 1
    POSE = 2
    IMU = 3
    SONAR = 4
    IMAGE = 5
    NOTICE = 127
    POSE_COMMAND = 128
    GOAL_POSE = 129


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame, its checks passed; `kind` may be a type that is not known here."""

    kind: int
    uav: int
    sequence: int
    stamp_ns: int
    payload: bytes


def limit_of(kind: int) -> int:
    """Most bytes that a payload of this type may have."""
    return IMAGE_LIMIT_BYTES if kind == Kind.IMAGE else OTHER_LIMIT_BYTES


def encode_head(kind: int, uav: int, sequence: int, stamp_ns: int, payload_bytes: int) -> bytes:
    """The first 26 bytes of a frame.

    Raises
    ------
    BridgeError
        The payload is too long, or a number does not fit its field.

    """
    if payload_bytes > limit_of(kind):
        raise BridgeError(
            f"a payload of type {int(kind)} has {payload_bytes} bytes; "
            f"the limit is {limit_of(kind)}"
        )
    try:
        head = _HEAD.pack(VERSION, kind, uav, payload_bytes, sequence & 0xFFFFFFFF, stamp_ns)
    except struct.error as error:
        raise BridgeError(f"type {kind}, UAV {uav}, stamp {stamp_ns} ns: {error}") from None
    return SYNC + head + _CRC.pack(crc_hqx(head, CRC_START))


def encode_frame(kind: int, uav: int, sequence: int, stamp_ns: int, payload: bytes) -> bytes:
    """A whole frame. `BridgeError` where something does not fit."""
    head = encode_head(kind, uav, sequence, stamp_ns, len(payload))
    check = crc_hqx(payload, crc_of_head(head))
    return b"".join((head, payload, _CRC.pack(check)))


def crc_of_head(head: bytes) -> int:
    """What the CRC of a frame is behind its head; continue it with `crc_hqx` over the payload."""
    return crc_hqx(head[len(SYNC) :], CRC_START)


def encode_tail(check: int) -> bytes:
    """The last two bytes of a frame."""
    return _CRC.pack(check)


class FrameParser:
    """Finds frames in a stream of bytes, whatever else is in it.

    It keeps no more than the frame in progress, takes time in proportion to what it is fed, and
    never raises. What is damaged is dropped and counted; the search goes on behind its sync word.
    A damaged frame whose payload holds whole frames yields those.

    limit_bytes: frames with longer payloads count as damaged, beside the limits of their types.
    """

    def __init__(self, limit_bytes: int = IMAGE_LIMIT_BYTES) -> None:
        self._limit = limit_bytes
        self._data = bytearray()
        self._wanted = HEAD_BYTES
        self._work_left = _SPARE_WORK_BYTES
        self.frames = 0
        """Frames found."""
        self.corrupt = 0
        """Sync words behind which no whole frame of our version stood."""
        self.noise_bytes = 0
        """Bytes that belonged to no frame, those of damaged ones included."""
        self.other_version: int | None = None
        """Version of the last frame that was dropped for its version alone."""
        self.too_long: str | None = None
        """What was said of the last frame that was dropped for its length alone."""

    @property
    def waiting_bytes(self) -> int:
        """Bytes of a frame in progress."""
        return len(self._data)

    def feed(self, data: bytes | bytearray | memoryview) -> list[Frame]:
        """The frames that are whole with these bytes."""
        self._data += data
        self._work_left += _WORK_PER_BYTE * len(data)
        return self._parse() if len(self._data) >= self._wanted else []

    def finish(self) -> list[Frame]:
        """Nothing more will come: the frames hidden in one that will never be whole."""
        frames: list[Frame] = []
        while len(self._data) >= HEAD_BYTES:
            frames += self._parse()
            if len(self._data) >= HEAD_BYTES:
                self._reject(len(SYNC))
                del self._data[: len(SYNC)]
        self.noise_bytes += len(self._data)
        self._data.clear()
        return frames

    def _parse(self) -> list[Frame]:
        frames: list[Frame] = []
        data, position = self._data, 0
        while True:
            start = self._next_sync(position)
            self.noise_bytes += start - position
            position = start
            self._wanted = HEAD_BYTES
            if len(data) - position < HEAD_BYTES:
                break
            size = self._size_at(position)
            if size is None:
                position += self._reject(len(SYNC))
                continue
            if len(data) - position < size:
                self._wanted = size
                break
            frame = self._frame_at(position, size)
            if frame is None:
                position += self._reject(len(SYNC) if self._work_left > 0 else size)
                continue
            frames.append(frame)
            position += size
        del data[:position]
        self.frames += len(frames)
        return frames

    def _reject(self, skipped: int) -> int:
        self.corrupt += 1
        self.noise_bytes += skipped
        return skipped

    def _next_sync(self, position: int) -> int:
        """Where the next sync word begins, or what may become one at the end."""
        data = self._data
        found = data.find(SYNC, position)
        if found >= 0:
            return found
        for length in range(min(len(SYNC) - 1, len(data) - position), 0, -1):
            if data.endswith(SYNC[:length]):
                return len(data) - length
        return len(data)

    def _size_at(self, position: int) -> int | None:
        """Bytes of the frame that begins here; None where its head is damaged."""
        head = self._data[position + len(SYNC) : position + HEAD_BYTES]
        (check,) = _CRC.unpack_from(head, _HEAD.size)
        if crc_hqx(head[: _HEAD.size], CRC_START) != check:
            return None
        version, kind, _, length, _, _ = _HEAD.unpack_from(head)
        if version != VERSION:
            self.other_version = version
            return None
        limit = min(limit_of(kind), self._limit)
        if length > limit:
            self.too_long = f"a payload of type {kind} with {length} bytes is over {limit} bytes"
            return None
        return HEAD_BYTES + int(length) + TAIL_BYTES

    def _frame_at(self, position: int, size: int) -> Frame | None:
        """The frame that begins here; None where it is damaged."""
        end = position + size - TAIL_BYTES
        self._work_left = min(self._work_left, _MOST_SPARED_BYTES) - size
        (check,) = _CRC.unpack_from(self._data, end)
        with memoryview(self._data) as view, view[position + len(SYNC) : end] as checked:
            if crc_hqx(checked, CRC_START) != check:
                return None
            payload = bytes(view[position + HEAD_BYTES : end])
        _, kind, uav, _, sequence, stamp_ns = _HEAD.unpack_from(self._data, position + len(SYNC))
        return Frame(kind, uav, sequence, stamp_ns, payload)
