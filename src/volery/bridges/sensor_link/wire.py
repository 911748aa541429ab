"""Encodes and parses the sensor link's frames, without a socket.

The environment (the simulation) listens, the ROS side connects; both send frames of one form, which
docs/sensor_link.md defines. The CRC is that of `core.framing`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

from volery.core.errors import BridgeError
from volery.core.framing import CRC_BYTES, Flaw, FrameScanner, crc16, crc_bytes

SYNC = b"\xaaVLY"
VERSION = 1
HEAD_BYTES = 26
IMAGE_LIMIT_BYTES = 64 << 20
"""Largest payload of an image: 4096 x 4096 pixels with 4 bytes each."""
OTHER_LIMIT_BYTES = 1 << 20

_HEAD = struct.Struct("<BBHIIq")


class SensorLinkKind(IntEnum):
    """Types of payload; below 128 from the environment, others to it."""

    LASER_SCAN = 1
    POSE = 2
    IMU = 3
    SONAR = 4
    IMAGE = 5
    NOTICE = 127
    POSE_COMMAND = 128
    GOAL_POSE = 129


@dataclass(frozen=True, slots=True)
class SensorLinkFrame:
    """One valid frame; `kind` may be an unknown type."""

    kind: int
    uav: int
    sequence: int
    stamp_ns: int
    payload: bytes


def limit_of(kind: int) -> int:
    """Returns the maximum size of a payload of this type, bytes."""
    return IMAGE_LIMIT_BYTES if kind == SensorLinkKind.IMAGE else OTHER_LIMIT_BYTES


def encode_head(kind: int, uav: int, sequence: int, stamp_ns: int, payload_bytes: int) -> bytes:
    """Returns the first 26 bytes of a frame.

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
    return SYNC + head + crc_bytes(crc16(head))


def encode_frame(kind: int, uav: int, sequence: int, stamp_ns: int, payload: bytes) -> bytes:
    """Returns a whole frame. Raises `BridgeError` if something does not fit."""
    head = encode_head(kind, uav, sequence, stamp_ns, len(payload))
    return b"".join((head, payload, crc_bytes(crc16(payload, crc_of_head(head)))))


def crc_of_head(head: bytes) -> int:
    """Returns the CRC of a frame after its head; continue it with `crc16` over the payload."""
    return crc16(head[len(SYNC) :])


class SensorLinkParser(FrameScanner[SensorLinkFrame]):
    """Finds the sensor link's frames in a stream of bytes.

    limit_bytes: frames with longer payloads count as damaged, besides the limits of their types.
    """

    def __init__(self, limit_bytes: int = IMAGE_LIMIT_BYTES) -> None:
        super().__init__(SYNC, HEAD_BYTES)
        self._limit = limit_bytes
        self.other_version: int | None = None
        """Version of the last frame that was dropped for its version alone."""
        self.too_long: str | None = None
        """Error of the last frame that was dropped for its length alone."""

    def payload_bytes(self, head: bytes | bytearray) -> int | Flaw:
        """Returns the length in a head, within the limits."""
        version, kind, _, length, _, _ = _HEAD.unpack(head)
        if version != VERSION:
            self.other_version = version
            return Flaw.VERSION
        limit = min(limit_of(kind), self._limit)
        if length > limit:
            self.too_long = f"a payload of type {kind} with {length} bytes is over {limit} bytes"
            return Flaw.LENGTH
        return int(length)

    def frame_of(self, view: memoryview) -> SensorLinkFrame:
        """Returns the frame of whole bytes."""
        _, kind, uav, _, sequence, stamp_ns = _HEAD.unpack_from(view, len(SYNC))
        payload = bytes(view[HEAD_BYTES : len(view) - CRC_BYTES])
        return SensorLinkFrame(kind, uav, sequence, stamp_ns, payload)
