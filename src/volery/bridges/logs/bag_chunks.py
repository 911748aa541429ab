"""The chunks of a ROS 1 bag (wiki.ros.org/Bags/Format/2.0)."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1.reader import decompressors

from volery.bridges.logs.chunks import Chunk, ChunkedLog, Content, Head, Span, Unindexed
from volery.bridges.logs.records import (
    BAG_MAGIC,
    CUT_OFF,
    PART_CHUNK,
    BagIndex,
    LogTopic,
    bag_fields,
)
from volery.core.clock import NS_PER_S

_MESSAGE, _INDEX, _CHUNK, _CONNECTION = b"\x02", b"\x04", b"\x05", b"\x07"
_LENGTH = struct.Struct("<I")
_TIME = struct.Struct("<II")


class BagChunks(ChunkedLog):
    """Chunks by the index records that follow each."""

    format = "bag"

    def _scan(self) -> None:
        found = self._found
        position = len(BAG_MAGIC)
        span: Span | None = None
        counts: dict[int, int] = {}
        stamps: list[NDArray[Any]] = []
        index = BagIndex()

        def end_chunk() -> None:
            nonlocal span
            if span is not None:
                found.append(_indexed(span, dict(counts), stamps) if counts else Unindexed(span))
            span = None
            counts.clear()
            stamps.clear()

        while position < self.size:
            record = self._record(position)
            if record is None:
                self.trouble = PART_CHUNK
                break
            fields, body, after = record
            index.pass_record(fields)
            kind = fields.get(b"op")
            if kind == _CHUNK:
                end_chunk()
                span = Span(position, after - position)
            elif kind == _INDEX and span is not None:
                (channel,) = _LENGTH.unpack(fields[b"conn"])
                data = self._read(body, after - body)
                if data:
                    stamps.append(np.frombuffer(data, "<u4").reshape(-1, 3))
                    counts[channel] = counts.get(channel, 0) + len(stamps[-1])
            elif kind == _CONNECTION:
                self._learn(fields, self._read(body, after - body))
            position = after
        end_chunk()
        if not index.is_whole and not self.trouble:
            self.trouble = CUT_OFF

    def _record(self, position: int) -> tuple[dict[bytes, bytes], int, int] | None:
        """Header fields, begin and end of the data of a record; None where it is not whole."""
        start = self._read(position, 4)
        if len(start) < 4:
            return None
        body = position + 4 + _LENGTH.unpack(start)[0]
        if body + 4 > self.size:
            return None
        head = self._read(position + 4, body - position)
        after = body + 4 + _LENGTH.unpack(head[-4:])[0]
        return None if after > self.size else (bag_fields(head[:-4]), body + 4, after)

    def _parse(self, data: bytes) -> Content:
        fields, begin, _ = _inner(data, 0)
        chunk = bytes(decompressors[fields[b"compression"].decode()](data[begin:]))
        heads = []
        position = 0
        while position < len(chunk):
            fields, begin, end = _inner(chunk, position)
            kind = fields[b"op"]
            if kind == _CONNECTION:
                self._learn(fields, chunk[begin:end])
            elif kind == _MESSAGE:
                (channel,) = _LENGTH.unpack(fields[b"conn"])
                sec, nsec = _TIME.unpack(fields[b"time"])
                heads.append(Head(channel, sec * NS_PER_S + nsec, begin, end, 0))
            position = end
        return Content(tuple(heads), chunk)

    def _learn(self, fields: dict[bytes, bytes], data: bytes) -> None:
        (channel,) = _LENGTH.unpack(fields[b"conn"])
        self.topics[channel] = LogTopic.of_bag(fields, bag_fields(data))


def _indexed(span: Span, counts: dict[int, int], stamps: list[NDArray[Any]]) -> Chunk:
    """A chunk by its index records: rows of seconds, nanoseconds, offset."""
    found = np.concatenate(stamps).astype(np.int64)
    found = found[np.argsort(found[:, 2])]
    return Chunk.of_times(span, counts, found[:, 0] * NS_PER_S + found[:, 1])


def _inner(data: bytes, position: int) -> tuple[dict[bytes, bytes], int, int]:
    """Header fields of a record in memory, begin and end of its data."""
    (length,) = _LENGTH.unpack_from(data, position)
    body = position + 4 + length
    (size,) = _LENGTH.unpack_from(data, body)
    if body + 4 + size > len(data):
        raise ValueError("the record is not whole")
    return bag_fields(data[position + 4 : body]), body + 4, body + 4 + size
