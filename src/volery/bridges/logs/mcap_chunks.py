"""Reads the chunks of an MCAP file (mcap.dev/spec, version 0)."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Schema
from numpy.typing import NDArray

from volery.bridges.logs import mcap_format
from volery.bridges.logs.budgets import MAX_CHUNK_MESSAGES, MAX_DEFINITION_BYTES, MAX_TIME_NS
from volery.bridges.logs.chunks import Chunk, ChunkedLog, Span, Unindexed
from volery.bridges.logs.content import Content
from volery.bridges.logs.records import CUT_OFF, MCAP_MAGIC, LogTopic, cut_at

_HEAD = mcap_format.HEAD
_INDEX = struct.Struct("<HL")
_ENTRIES = np.dtype([("time", "<u8"), ("offset", "<u8")])
_LOOSE_BYTES = 1 << 20
"""Limit of bytes up to which messages outside of chunks are grouped."""


class McapChunks(ChunkedLog):
    """Indexes chunks by their message indexes; groups messages outside of chunks."""

    format = "mcap"

    def _scan(self) -> None:
        self._schemas: dict[int, Schema] = {}
        self._chunk: Span | None = None
        self._entries: dict[int, NDArray[Any]] = {}
        self._loose: Span | None = None
        position = len(MCAP_MAGIC)
        while True:
            head = self._read(position, _HEAD.size)
            if len(head) < _HEAD.size:
                self._cut = CUT_OFF
                break
            opcode, length = _HEAD.unpack(head)
            span = Span(position, _HEAD.size + length)
            position += span.length
            if position > self.size:
                self._cut = cut_at(span.position)
                break
            if opcode == Opcode.FOOTER:
                if self._read(position, len(MCAP_MAGIC)) != MCAP_MAGIC:
                    self._cut = CUT_OFF
                break
            self._count_record()
            try:
                self._take(opcode, span)
            except ValueError as error:
                self._damage.add(span.position, error)
        self._end_chunk()

    def _take(self, opcode: int, span: Span) -> None:
        """Handles a record outside of chunks. Raises `ValueError` if it is damaged."""
        if opcode == Opcode.MESSAGE_INDEX and self._chunk is not None:
            self._index(span)
        elif opcode == Opcode.MESSAGE:
            loose = self._loose
            if loose is None or loose.length > _LOOSE_BYTES:
                self._end_chunk()
                loose = Span(span.position, 0)
            self._loose = Span(loose.position, span.position + span.length - loose.position)
        elif opcode == Opcode.CHUNK:
            self._end_chunk()
            self._chunk = span
        elif opcode in mcap_format.DEFINITIONS:
            begin = span.position + _HEAD.size
            length = min(span.length - _HEAD.size, MAX_DEFINITION_BYTES + 1)
            self._learn(opcode, self._read(begin, length))

    def _index(self, span: Span) -> None:
        """Reads the times of one channel in the current chunk.

        Without a valid index the chunk is read.
        """
        begin = span.position + _HEAD.size
        head = self._read(begin, min(span.length - _HEAD.size, _INDEX.size))
        channel, length = _INDEX.unpack(head) if len(head) == _INDEX.size else (0, 1)
        count, rest = divmod(length, _ENTRIES.itemsize)
        known = sum(len(entries) for entries in self._entries.values())
        # later versions of the format may add fields at the end of a record
        fits = length <= span.length - _HEAD.size - _INDEX.size
        if rest or not fits or count > MAX_CHUNK_MESSAGES - known:
            self._forget_index()
            raise ValueError("the index of a chunk is damaged or too long")
        entries = np.frombuffer(self._read(begin + _INDEX.size, length), _ENTRIES)
        if len(entries) and entries["time"].max() > MAX_TIME_NS:
            self._forget_index()
            raise ValueError("the index of a chunk has a time later than ROS can represent")
        if len(entries):
            self._entries[channel] = entries

    def _forget_index(self) -> None:
        if self._chunk is not None:
            self._found.append(Unindexed(self._chunk))
        self._chunk = None
        self._entries.clear()

    def _end_chunk(self) -> None:
        if self._chunk is not None:
            known = _indexed(self._chunk, self._entries) if self._entries else None
            self._found.append(known or Unindexed(self._chunk))
        if self._loose is not None:
            self._found.append(Unindexed(self._loose))
        self._chunk = self._loose = None
        self._entries.clear()

    def _parse(self, data: bytes) -> Content:
        if data[0] == Opcode.CHUNK:
            data = mcap_format.unpack_chunk(memoryview(data)[_HEAD.size :])
        return mcap_format.chunk_content(data, self._learn)

    def _learn(self, opcode: int, data: bytes) -> None:
        record = mcap_format.definition(opcode, data)
        if isinstance(record, Schema):
            if record.id not in self._schemas:
                self._described.spend(len(record.data))
            self._schemas[record.id] = record
        else:
            if record.id not in self.topics:
                self._described.spend(0)
            schema = self._schemas.get(record.schema_id)
            self.topics[record.id] = LogTopic.of_mcap(record, schema)


def _indexed(span: Span, entries: Mapping[int, NDArray[Any]]) -> Chunk:
    """Returns a chunk from its message indexes."""
    counts = {channel: len(found) for channel, found in entries.items()}
    found = np.concatenate(list(entries.values()))
    times = found["time"][np.argsort(found["offset"])].astype(np.int64)
    return Chunk.of_times(span, counts, times)
