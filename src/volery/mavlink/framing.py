"""Cuts a stream of bytes into MAVLink frames; the stream may begin anywhere and contain noise.

A frame is valid if its start, length, message id and checksum agree. Otherwise the search continues
with the next byte, so that noise does not hide a whole frame. MAVLink 1 and 2 are supported;
signatures are not checked here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from volery.mavlink.codec import NEWER, check_of, crc_extra_of, dialect

_SECOND, _FIRST = 0xFD, 0xFE
"""Start of a frame of MAVLink 2 and 1."""
SIGNED = 1
"""The only supported flag of a frame; frames with other flags cannot be parsed."""
_SIGNATURE = 13


class MavlinkFrame(NamedTuple):
    """One frame: its bytes, and the ids that routing needs."""

    data: bytes
    message: int
    system: int
    component: int


class Framer:
    """Converts bytes to frames."""

    def __init__(self) -> None:
        self._rest = b""
        self._known = dialect().mavlink_map

    def feed(self, data: bytes) -> list[MavlinkFrame]:
        """Returns the frames that `data` completes; an unfinished one waits for the next call."""
        data, frames, at = self._rest + data, [], 0
        while at < len(data):
            start = _start_in(data, at)
            length = _length_at(data, start)
            if length is None or start + length > len(data):
                at = start
                if start < len(data) and not _may_grow(data, start):
                    at = start + 1
                    continue
                break
            frame = self._frame(data[start : start + length])
            if frame is None:
                at = start + 1
            else:
                frames.append(frame)
                at = start + length
        self._rest = data[at:]
        return frames

    def datagram(self, data: bytes) -> list[MavlinkFrame]:
        """Returns the frames of a datagram; the datagram contains no partial frames."""
        frames = self.feed(data)
        while self._rest:  # the assumed start of a frame was none
            self._rest, rest = b"", self._rest[1:]
            frames += self.feed(rest)
        return frames

    def _frame(self, data: bytes) -> MavlinkFrame | None:
        """Returns the frame of these bytes; None if they are no frame."""
        if data[0] == _FIRST:
            system, component, number = data[3], data[4], data[5]
            end = 6 + data[1]
        else:
            system, component = data[5], data[6]
            number = int.from_bytes(data[7:10], "little")
            end = 10 + data[1]
        known = number in self._known or number in NEWER
        if not known or (data[0] == _SECOND and data[2] & ~SIGNED):
            return None
        check = check_of(data[1:end] + bytes((crc_extra_of(number),)))
        if check != int.from_bytes(data[end : end + 2], "little"):
            return None
        return MavlinkFrame(data, number, system, component)


def lengths_of(data: bytes) -> Iterator[int]:
    """Yields the length in bytes of each of the MAVLink 2 frames in `data`."""
    at = 0
    while at < len(data):
        length = 12 + data[at + 1] + (_SIGNATURE if data[at + 2] & SIGNED else 0)
        yield length
        at += length


def _start_in(data: bytes, at: int) -> int:
    """Returns the index at which the next frame may start."""
    second, first = data.find(_SECOND, at), data.find(_FIRST, at)
    found = [index for index in (second, first) if index >= 0]
    return min(found, default=len(data))


def _length_at(data: bytes, start: int) -> int | None:
    """Returns the length in bytes of the frame that starts here; None if not known yet."""
    if len(data) - start < 3:
        return None
    if data[start] == _FIRST:
        return 8 + data[start + 1]
    return 12 + data[start + 1] + (_SIGNATURE if data[start + 2] & SIGNED else 0)


def _may_grow(data: bytes, start: int) -> bool:
    """Returns whether the received part can still become a frame."""
    return not (data[start] == _SECOND and len(data) - start > 2 and data[start + 2] & ~SIGNED)
