"""Frames in a stream of bytes: found by a sync word, guarded by two CRC-16s.

A frame is a head of fixed size, which begins with the sync word and ends with a CRC of what lies
between, then a payload whose length the head tells, then a CRC of everything behind the sync word.
The head's own CRC tells a damaged length before anyone waits for it. CRCs are little-endian u16.

The CRC is CRC-16/CCITT-FALSE: polynomial x^16 + x^12 + x^5 + 1 (0x1021), initial value 0xFFFF,
neither input nor output reflected, nothing xored at the end; of the ASCII text `123456789` it is
0x29B1.
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
_MOST_SPARED_BYTES = 256 << 20
_WORK_PER_BYTE = 4
"""Bytes checked at most for each byte received, beside the spare ones.

Frames inside of damaged frames are looked for by checking the same bytes again. Only a peer who
nests forged heads gets beyond this; damaged frames of his are then passed over whole.
"""


class Flaw(Enum):
    """Why what stands behind a sync word is no frame."""

    HEAD = "damaged head"
    VERSION = "another version"
    LENGTH = "payload too long"
    BODY = "damaged payload"
    CUT = "cut off"


def crc16(data: bytes | bytearray | memoryview, start: int = CRC_START) -> int:
    """CRC-16/CCITT-FALSE of the bytes; `start`: the CRC of those before them."""
    return crc_hqx(data, start)


def crc_bytes(check: int) -> bytes:
    """A CRC as it stands in a frame."""
    return _CRC.pack(check)


class FrameScanner(ABC, Generic[T]):
    """Finds frames in a stream of bytes, whatever else is in it.

    It keeps no more than the frame in progress, takes time in proportion to what it is fed, and
    never raises. What is damaged is dropped and counted; the search goes on behind its sync word.
    A damaged frame whose payload holds whole frames yields those.

    sync: the sync word. head_bytes: of the head, sync word and CRC included.
    """

    def __init__(self, sync: bytes, head_bytes: int) -> None:
        self._sync = sync
        self._head_bytes = head_bytes
        self._data = bytearray()
        self._wanted = head_bytes
        self._work_left = _SPARE_WORK_BYTES
        self.frames = 0
        """Frames found."""
        self.flaws: Counter[Flaw] = Counter()
        """Sync words behind which no whole frame of our version stood, by reason."""
        self.noise_bytes = 0
        """Bytes that belonged to no frame, those of damaged ones included."""

    @abstractmethod
    def payload_bytes(self, head: bytes | bytearray) -> int | Flaw:
        """Length of the payload behind a head whose CRC is right, sync word left away."""

    @abstractmethod
    def frame_of(self, view: memoryview) -> T:
        """The frame of these bytes, all checks passed; the view is void afterwards."""

    @property
    def corrupt(self) -> int:
        """Damaged frames of every kind."""
        return self.flaws.total()

    @property
    def waiting_bytes(self) -> int:
        """Bytes of a frame in progress."""
        return len(self._data)

    def feed(self, data: bytes | bytearray | memoryview) -> list[T]:
        """The frames that are whole with these bytes."""
        self._data += data
        self._work_left += _WORK_PER_BYTE * len(data)
        return self._parse() if len(self._data) >= self._wanted else []

    def finish(self) -> list[T]:
        """Nothing more will come: the frames hidden in one that will never be whole."""
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
        """Where the next sync word begins, or what may become one at the end."""
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
        """Bytes of the frame that begins here, or what is wrong with its head."""
        end = position + self._head_bytes - CRC_BYTES
        head = self._data[position + len(self._sync) : end]
        (check,) = _CRC.unpack_from(self._data, end)
        if crc_hqx(head, CRC_START) != check:
            return Flaw.HEAD
        length = self.payload_bytes(head)
        return length if isinstance(length, Flaw) else self._head_bytes + length + CRC_BYTES

    def _whole(self, position: int, size: int) -> bool:
        """Whether the frame that begins here is undamaged."""
        end = position + size - CRC_BYTES
        self._work_left = min(self._work_left, _MOST_SPARED_BYTES) - size
        (check,) = _CRC.unpack_from(self._data, end)
        start = position + len(self._sync)
        with memoryview(self._data) as view, view[start:end] as checked:
            return crc_hqx(checked, CRC_START) == int(check)
