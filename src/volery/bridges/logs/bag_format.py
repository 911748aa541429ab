"""Parses records of ROS 1 bags (wiki.ros.org/Bags/Format/2.0). Raises `ValueError` if damaged."""

from __future__ import annotations

import struct
from collections.abc import Callable

from volery.bridges.logs.budgets import (
    MAX_CHUNK_MESSAGES,
    MAX_DEFINITION_BYTES,
    MAX_TIME_NS,
)
from volery.bridges.logs.content import Content, Head
from volery.bridges.logs.unpacking import unpack
from volery.core.clock import NS_PER_S

MESSAGE, HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = (bytes([k]) for k in (2, 3, 4, 5, 6, 7))
"""Values of a record's field `op`."""
FIRST_BYTES = 4096
"""Size of a bag's first record, which spaces fill up; some writers leave out the spaces' number."""
_LENGTH = struct.Struct("<I")
_TIME = struct.Struct("<II")


class BagIndex:
    """Checks whether a bag has an index with a record of every chunk."""

    def __init__(self) -> None:
        self._is_begun = False
        self._missing = 0

    def pass_record(self, fields: dict[bytes, bytes]) -> None:
        """Reads the header fields of the next record of the file."""
        kind = fields.get(b"op")
        if kind == HEADER:
            self._is_begun = any(fields.get(b"index_pos", b""))
            self._missing = int.from_bytes(fields.get(b"chunk_count", b""), "little")
        elif kind == CHUNK_INFO:
            self._missing -= 1

    @property
    def is_whole(self) -> bool:
        """Whether the whole index has been read."""
        return self._is_begun and self._missing <= 0


def bag_fields(data: bytes) -> dict[bytes, bytes]:
    """Returns the fields of a record's header."""
    fields: dict[bytes, bytes] = {}
    position = 0
    while position + 4 <= len(data):
        (length,) = _LENGTH.unpack_from(data, position)
        name, _, value = data[position + 4 : position + 4 + length].partition(b"=")
        fields[name] = value
        position += 4 + length
    return fields


def number(fields: dict[bytes, bytes], name: bytes) -> int:
    """Returns a field of four bytes."""
    value = fields.get(name, b"")
    if len(value) != _LENGTH.size:
        raise ValueError(f"a record lacks its field '{name.decode()}'")
    return int(_LENGTH.unpack(value)[0])


def time_ns(fields: dict[bytes, bytes], name: bytes = b"time") -> int:
    """Returns a field with a time, ns."""
    value = fields.get(name, b"")
    if len(value) != _TIME.size:
        raise ValueError(f"a record lacks its field '{name.decode()}'")
    seconds, nanoseconds = _TIME.unpack(value)
    return checked_time_ns(seconds * NS_PER_S + nanoseconds)


def checked_time_ns(at_ns: int) -> int:
    """Returns the same time. Raises `ValueError` if ROS 2 cannot represent it."""
    if at_ns > MAX_TIME_NS:
        raise ValueError(f"a message of {at_ns} ns, later than ROS 2 can represent")
    return at_ns


def unpack_chunk(fields: dict[bytes, bytes], data: bytes | memoryview) -> bytes:
    """Returns the records in a chunk from its header's fields and its data."""
    compression = fields.get(b"compression", b"").decode()
    return unpack(compression, data, number(fields, b"size"))


def chunk_content(
    chunk: bytes, connect: Callable[[int, dict[bytes, bytes], bytes], None]
) -> Content:
    """Returns the messages among consecutive records; calls `connect` for connections."""
    heads = []
    position = 0
    while position < len(chunk):
        fields, begin, position = inner_record(chunk, position)
        kind = fields.get(b"op")
        if kind == CONNECTION:
            if position - begin > MAX_DEFINITION_BYTES:
                raise ValueError(f"a message definition of {position - begin} bytes")
            connect(number(fields, b"conn"), fields, chunk[begin:position])
        elif kind == MESSAGE:
            heads.append(Head(number(fields, b"conn"), time_ns(fields), begin, position, 0))
            if len(heads) > MAX_CHUNK_MESSAGES:
                raise ValueError(f"more than {MAX_CHUNK_MESSAGES} messages in one chunk")
    return Content(tuple(heads), chunk)


def inner_record(data: bytes, position: int) -> tuple[dict[bytes, bytes], int, int]:
    """Returns header fields of a record in memory, start and end of its data."""
    body = _end_of(data, position)
    return bag_fields(data[position + 4 : body]), body + 4, _end_of(data, body)


def _end_of(data: bytes, position: int) -> int:
    """Returns the end of the bytes whose length is at a position."""
    if position + 4 > len(data):
        raise ValueError("a record is incomplete")
    end = position + 4 + int(_LENGTH.unpack_from(data, position)[0])
    if end > len(data):
        raise ValueError("a record is incomplete")
    return end
