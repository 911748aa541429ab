"""Cuts a stream of bytes into MAVLink frames; the stream may begin anywhere and hold noise.

A frame counts where its start, its length, its message's id and its checksum agree; else the search
goes on with the next byte, so that nothing that is whole gets lost behind noise. Both generations
of frames are known; signatures are not looked at here.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from volery.mavlink.codec import NEWER, check_of, crc_extra_of, dialect

_SECOND, _FIRST = 0xFD, 0xFE
"""Start of a frame of MAVLink 2 and 1."""
SIGNED = 1
"""The only flag of a frame that may be set: others say that it cannot be understood."""
_SIGNATURE = 13


class MavlinkFrame(NamedTuple):
    """One frame: its bytes, and what routing needs."""

    data: bytes
    message: int
    system: int
    component: int


class Framer:
    """Feed it bytes, get frames."""

    def __init__(self) -> None:
        self._rest = b""
        self._known = dialect().mavlink_map

    def feed(self, data: bytes) -> list[MavlinkFrame]:
        """Frames that `data` completes; an unfinished one waits for the rest."""
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
        """Frames of a datagram, in which they are whole or broken."""
        frames = self.feed(data)
        while self._rest:  # what looked like a beginning was none
            self._rest, rest = b"", self._rest[1:]
            frames += self.feed(rest)
        return frames

    def _frame(self, data: bytes) -> MavlinkFrame | None:
        """The frame of these bytes; None where they are none."""
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
    """Bytes of each of the frames of MAVLink 2 that `data` is made of."""
    at = 0
    while at < len(data):
        length = 12 + data[at + 1] + (_SIGNATURE if data[at + 2] & SIGNED else 0)
        yield length
        at += length


def _start_in(data: bytes, at: int) -> int:
    """Where the next frame may start."""
    second, first = data.find(_SECOND, at), data.find(_FIRST, at)
    found = [place for place in (second, first) if place >= 0]
    return min(found, default=len(data))


def _length_at(data: bytes, start: int) -> int | None:
    """Bytes of the frame that starts here; None where that is not known yet."""
    if len(data) - start < 3:
        return None
    if data[start] == _FIRST:
        return 8 + data[start + 1]
    return 12 + data[start + 1] + (_SIGNATURE if data[start + 2] & SIGNED else 0)


def _may_grow(data: bytes, start: int) -> bool:
    """Whether what is there of a frame can still become one."""
    return not (data[start] == _SECOND and len(data) - start > 2 and data[start + 2] & ~SIGNED)
