"""Reads the chunks of a ROS 1 bag (wiki.ros.org/Bags/Format/2.0)."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.bridges.logs import bag_format
from volery.bridges.logs.bag_format import BagIndex, bag_fields
from volery.bridges.logs.budgets import (
    MAX_CHUNK_MESSAGES,
    MAX_DEFINITION_BYTES,
    MAX_HEAD_BYTES,
    MAX_TIME_NS,
)
from volery.bridges.logs.chunks import Chunk, ChunkedLog, Span, Unindexed
from volery.bridges.logs.content import Content
from volery.bridges.logs.records import BAG_MAGIC, CUT_OFF, LogTopic, cut_at
from volery.core.clock import NS_PER_S

_LENGTH = struct.Struct("<I")
_STAMP_BYTES = 12
"""Bytes of an index entry: seconds, nanoseconds, offset."""


class BagChunks(ChunkedLog):
    """Indexes chunks by the index records that follow each."""

    format = "bag"

    def _scan(self) -> None:
        self._chunk: Span | None = None
        self._counts: dict[int, int] = {}
        self._stamps: list[NDArray[Any]] = []
        position = len(BAG_MAGIC)
        index = BagIndex()
        while position < self.size:
            record = self._record(position)
            if record is None:
                self._cut = cut_at(position)
                break
            fields, body, after = record
            self._count_record()
            index.pass_record(fields)
            try:
                self._take(fields, Span(position, after - position), body)
            except ValueError as error:
                self._damage.add(position, error)
            position = after
        self._end_chunk()
        if not index.is_whole and not self._cut:
            self._cut = CUT_OFF

    def _take(self, fields: dict[bytes, bytes], span: Span, body: int) -> None:
        """Handles a record outside of chunks, its data from `body` on.

        Raises `ValueError` if damaged.
        """
        kind = fields.get(b"op")
        length = span.position + span.length - body
        if kind == bag_format.CHUNK:
            self._end_chunk()
            self._chunk = span
        elif kind == bag_format.INDEX and self._chunk is not None:
            self._index(fields, body, length)
        elif kind == bag_format.CONNECTION:
            if length > MAX_DEFINITION_BYTES:
                raise ValueError(f"a message definition of {length} bytes")
            self._learn(bag_format.number(fields, b"conn"), fields, self._read(body, length))

    def _index(self, fields: dict[bytes, bytes], body: int, length: int) -> None:
        """Reads the times of one channel in the current chunk.

        Without a valid index the chunk is read.
        """
        known = sum(len(stamps) for stamps in self._stamps)
        stamps = None
        if not length % _STAMP_BYTES and length // _STAMP_BYTES <= MAX_CHUNK_MESSAGES - known:
            stamps = np.frombuffer(self._read(body, length), "<u4").reshape(-1, 3).astype(np.int64)
            times = stamps[:, 0] * NS_PER_S + stamps[:, 1]
        if stamps is None or (len(stamps) and times.max() > MAX_TIME_NS):
            if self._chunk is not None:
                self._found.append(Unindexed(self._chunk))
            self._forget_chunk()
            raise ValueError("the index of a chunk is damaged or too long")
        if len(stamps):
            channel = bag_format.number(fields, b"conn")
            self._stamps.append(stamps)
            self._counts[channel] = self._counts.get(channel, 0) + len(stamps)

    def _end_chunk(self) -> None:
        if self._chunk is not None:
            chunk, counts = self._chunk, dict(self._counts)
            self._found.append(
                _indexed(chunk, counts, self._stamps) if counts else Unindexed(chunk)
            )
        self._forget_chunk()

    def _forget_chunk(self) -> None:
        self._chunk = None
        self._counts.clear()
        self._stamps.clear()

    def _record(self, position: int) -> tuple[dict[bytes, bytes], int, int] | None:
        """Returns header fields, start and end of the data of a record.

        None if it is incomplete.
        """
        start = self._read(position, 4)
        if len(start) < 4:
            return None
        length = _LENGTH.unpack(start)[0]
        body = position + 4 + length
        if body + 4 > self.size:
            return None
        head = self._read(position + 4, length) if length <= MAX_HEAD_BYTES else b""
        after = body + 4 + _LENGTH.unpack(self._read(body, 4))[0]
        if after > self.size and position == len(BAG_MAGIC):
            after = position + bag_format.FIRST_BYTES
        return None if after > self.size else (bag_fields(head), body + 4, after)

    def _parse(self, data: bytes) -> Content:
        fields, begin, _ = bag_format.inner_record(data, 0)
        chunk = bag_format.unpack_chunk(fields, memoryview(data)[begin:])
        return bag_format.chunk_content(chunk, self._learn)

    def _learn(self, channel: int, fields: dict[bytes, bytes], data: bytes) -> None:
        if channel not in self.topics:
            self._described.spend(len(data))
        self.topics[channel] = LogTopic.of_bag(fields, data)


def _indexed(span: Span, counts: dict[int, int], stamps: list[NDArray[np.int64]]) -> Chunk:
    """Returns a chunk from its index records: rows of seconds, nanoseconds, offset."""
    found = np.concatenate(stamps)
    found = found[np.argsort(found[:, 2])]
    return Chunk.of_times(span, counts, found[:, 0] * NS_PER_S + found[:, 1])
