"""The chunks of an MCAP file (mcap.dev/spec, version 0)."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from typing import Any

import lz4.frame
import numpy as np
import zstandard
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from volery.bridges.logs.chunks import Chunk, ChunkedLog, Content, Head, Span, Unindexed
from volery.bridges.logs.records import CUT_OFF, MCAP_MAGIC, PART_CHUNK, LogTopic, mcap_records

_HEAD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQIL")
"""Start, end, size uncompressed, CRC-32, length of the compression's name."""
_MESSAGE = struct.Struct("<HIQ")
"""Channel, sequence, log time; the publish time follows."""
_MESSAGE_BYTES = 22
_INDEX = struct.Struct("<HL")
_ENTRIES = np.dtype([("time", "<u8"), ("offset", "<u8")])
_LOOSE_BYTES = 1 << 20
"""Messages outside of chunks are taken together up to so many bytes."""


class McapChunks(ChunkedLog):
    """Chunks by their message indexes; messages outside of chunks in runs."""

    format = "mcap"

    def _scan(self) -> None:
        self._schemas: dict[int, Schema] = {}
        found = self._found
        position = len(MCAP_MAGIC)
        chunk: Span | None = None
        entries: dict[int, NDArray[Any]] = {}
        loose: Span | None = None

        def end_chunk() -> None:
            nonlocal chunk, loose
            if chunk is not None:
                found.append(_indexed(chunk, entries) if entries else Unindexed(chunk))
            if loose is not None:
                found.append(Unindexed(loose))
            chunk = loose = None
            entries.clear()

        while True:
            head = self._read(position, _HEAD.size)
            if len(head) < _HEAD.size:
                self.trouble = CUT_OFF
                break
            opcode, length = _HEAD.unpack(head)
            body, after = position + _HEAD.size, position + _HEAD.size + length
            if after > self.size:
                self.trouble = PART_CHUNK
                break
            if opcode == Opcode.FOOTER:
                if self._read(after, len(MCAP_MAGIC)) != MCAP_MAGIC:
                    self.trouble = CUT_OFF
                break
            if opcode == Opcode.MESSAGE_INDEX and chunk is not None:
                data = self._read(body, length)
                channel, size = _INDEX.unpack_from(data)
                if size:
                    entries[channel] = np.frombuffer(data[_INDEX.size :], _ENTRIES)
            elif opcode == Opcode.MESSAGE:
                if loose is None or loose.length > _LOOSE_BYTES:
                    end_chunk()
                    loose = Span(position, 0)
                loose = Span(loose.position, after - loose.position)
            elif opcode == Opcode.CHUNK:
                end_chunk()
                chunk = Span(position, after - position)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._learn(opcode, self._read(body, length))
            position = after
        end_chunk()

    def _parse(self, data: bytes) -> Content:
        if data[0] == Opcode.CHUNK:
            data = _unpacked(memoryview(data)[_HEAD.size :])
        heads = []
        position, size = 0, len(data)
        while position < size:
            opcode, length = _HEAD.unpack_from(data, position)
            body = position + _HEAD.size
            position = body + length
            if opcode == Opcode.MESSAGE:
                channel, sequence, time_ns = _MESSAGE.unpack_from(data, body)
                heads.append(Head(channel, time_ns, body + _MESSAGE_BYTES, position, sequence))
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._learn(opcode, data[body:position])
        return Content(tuple(heads), data)

    def _learn(self, opcode: int, data: bytes) -> None:
        for record in mcap_records(opcode, data):
            if isinstance(record, Schema):
                self._schemas[record.id] = record
            elif isinstance(record, Channel):
                schema = self._schemas.get(record.schema_id)
                self.topics[record.id] = LogTopic.of_mcap(record, schema)


def _indexed(span: Span, entries: Mapping[int, NDArray[Any]]) -> Chunk:
    """A chunk by its message indexes."""
    counts = {channel: len(found) for channel, found in entries.items()}
    found = np.concatenate(list(entries.values()))
    times = found["time"][np.argsort(found["offset"])].astype(np.int64)
    return Chunk.of_times(span, counts, times)


def _unpacked(chunk: memoryview) -> bytes:
    """The records in a chunk. `ValueError` where they are damaged."""
    _, _, size, crc, name_length = _CHUNK.unpack_from(chunk)
    begin = _CHUNK.size + name_length
    compression = bytes(chunk[_CHUNK.size : begin]).decode()
    packed = chunk[begin + 8 :]
    if compression == "lz4":
        data = lz4.frame.decompress(packed)
    elif compression == "zstd":
        data = zstandard.ZstdDecompressor().decompress(packed, size)
    else:
        data = bytes(packed)
    if crc and zlib.crc32(data) != crc:
        raise ValueError("the chunk is damaged")
    return bytes(data)
