"""Finds frames in a stream of bytes by a sync word, and checks them by two CRC-16s.

A frame is a head of fixed size, which starts with the sync word and ends with a CRC of the bytes
between, then a payload whose length is in the head, then a CRC of everything after the sync word.
The head's own CRC detects a damaged length before the payload arrives. CRCs are little-endian u16.

The CRC is CRC-16/CCITT-FALSE: polynomial x^16 + x^12 + x^5 + 1 (0x1021), initial value 0xFFFF,
neither input nor output reflected, no final XOR; the CRC of the ASCII text `123456789` is 0x29B1.
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from binascii import crc_hqx
from collections import Counter
from enum import Enum
from typing import Generic, TypeVar

T = TypeVar("T")

CRC_START = 0xFFFF
CRC_BYTES = 2

_CRC = struct.Struct("<H")
_SPARE_WORK_BYTES = 4 << 20
_MAX_SPARE_BYTES = 256 << 20
_WORK_PER_BYTE = 4
"""Maximum of bytes checked per byte received, plus the spare bytes.

The scanner searches damaged frames for inner frames by checking the same bytes again. Only a peer
that nests forged heads exceeds the limit; its damaged frames are then skipped whole.
"""


class Flaw(Enum):
    """Reason why the bytes after a sync word are not a frame."""

    HEAD = "damaged head"
    VERSION = "another version"
    LENGTH = "payload too long"
    BODY = "damaged payload"
    CUT = "cut off"


def crc16(data: bytes | bytearray | memoryview, start: int = CRC_START) -> int:
    """Returns the CRC-16/CCITT-FALSE of the bytes; `start`: the CRC of the bytes before."""
    return crc_hqx(data, start)


def crc_bytes(check: int) -> bytes:
    """Returns a CRC as encoded in a frame."""
    return _CRC.pack(check)


class FrameScanner(ABC, Generic[T]):
    """Finds frames in a stream of bytes with arbitrary content between them.

    The scanner stores no more than the current frame, takes time proportional to its input, and
    never raises. Damaged frames are dropped and counted; the search continues after their sync
    word. A damaged frame whose payload contains complete frames yields those.

    sync: the sync word. head_bytes: size of the head, sync word and CRC included.
    """

    def __init__(self, sync: bytes, head_bytes: int) -> None:
        self._sync = sync
        self._head_bytes = head_bytes
        self._data = bytearray()
        self._wanted = head_bytes
        self._work_left = _SPARE_WORK_BYTES
        self.frames = 0
        """Number of frames found."""
        self.flaws: Counter[Flaw] = Counter()
        """Number of sync words without a valid frame, by reason."""
        self.noise_bytes = 0
        """Number of bytes outside of valid frames."""

    @abstractmethod
    def payload_bytes(self, head: bytes | bytearray) -> int | Flaw:
        """Returns the payload length given a head with a valid CRC, without its sync word."""

    @abstractmethod
    def frame_of(self, view: memoryview) -> T:
        """Returns the frame of valid bytes; the view becomes invalid afterwards."""

    @property
    def corrupt(self) -> int:
        """Number of damaged frames of every kind."""
        return self.flaws.total()

    @property
    def waiting_bytes(self) -> int:
        """Number of bytes of the current frame."""
        return len(self._data)

    def feed(self, data: bytes | bytearray | memoryview) -> list[T]:
        """Returns the frames that these bytes complete."""
        self._data += data
        self._work_left += _WORK_PER_BYTE * len(data)
        return self._parse() if len(self._data) >= self._wanted else []

    def finish(self) -> list[T]:
        """Ends the stream; returns the frames inside an incomplete frame."""
        frames: list[T] = []
        while len(self._data) >= self._head_bytes:
            frames += self._parse()
            if len(self._data) >= self._head_bytes:
                self._reject(Flaw.CUT, len(self._sync))
                del self._data[: len(self._sync)]
        self.noise_bytes += len(self._data)
        self._data.clear()
        return frames

    def _parse(self) -> list[T]:
        frames: list[T] = []
        data, position, sync_bytes = self._data, 0, len(self._sync)
        while True:
            start = self._next_sync(position)
            self.noise_bytes += start - position
            position = start
            self._wanted = self._head_bytes
            if len(data) - position < self._head_bytes:
                break
            size = self._size_at(position)
            if isinstance(size, Flaw):
                position += self._reject(size, sync_bytes)
                continue
            if len(data) - position < size:
                self._wanted = size
                break
            if not self._whole(position, size):
                skipped = sync_bytes if self._work_left > 0 else size
                position += self._reject(Flaw.BODY, skipped)
                continue
            with memoryview(data) as view, view[position : position + size] as frame:
                frames.append(self.frame_of(frame))
            position += size
        del data[:position]
        self.frames += len(frames)
        return frames

    def _reject(self, flaw: Flaw, skipped: int) -> int:
        self.flaws[flaw] += 1
        self.noise_bytes += skipped
        return skipped

    def _next_sync(self, position: int) -> int:
        """Returns the position of the next sync word, or of its possible start at the end."""
        data, sync = self._data, self._sync
        if data.startswith(sync, position):
            return position
        if position == len(data):
            return position
        found = data.find(sync, position)
        if found >= 0:
            return found
        for length in range(min(len(sync) - 1, len(data) - position), 0, -1):
            if data.endswith(sync[:length]):
                return len(data) - length
        return len(data)

    def _size_at(self, position: int) -> int | Flaw:
        """Returns the size of the frame that starts here, or its head's flaw."""
        end = position + self._head_bytes - CRC_BYTES
        head = self._data[position + len(self._sync) : end]
        (check,) = _CRC.unpack_from(self._data, end)
        if crc_hqx(head, CRC_START) != check:
            return Flaw.HEAD
        length = self.payload_bytes(head)
        return length if isinstance(length, Flaw) else self._head_bytes + length + CRC_BYTES

    def _whole(self, position: int, size: int) -> bool:
        """Returns whether the frame that starts here is undamaged."""
        end = position + size - CRC_BYTES
        self._work_left = min(self._work_left, _MAX_SPARE_BYTES) - size
        (check,) = _CRC.unpack_from(self._data, end)
        start = position + len(self._sync)
        with memoryview(self._data) as view, view[start:end] as checked:
            return crc_hqx(checked, CRC_START) == int(check)
