"""Walks through the records of a log, whole or cut off, without needing its index.

A killed run leaves a file without its tail. Its chunks stand one behind the other, each with its
length, so they can be read until the file ends in the middle of one.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import breakup_chunk
from rosbags.rosbag1.reader import decompressors

from volery.core.errors import RecordingError

MCAP_MAGIC = b"\x89MCAP0\r\n"
BAG_MAGIC = b"#ROSBAG V2.0\n"

CUT_OFF = "cut off: the index at its end is missing"
PART_CHUNK = "cut off in the middle of a chunk"


@dataclass(frozen=True)
class LogTopic:
    """A topic as the log describes it."""

    topic: str
    msgtype: str
    """ROS 2 style name, `sensor_msgs/msg/LaserScan`."""
    definition: str
    encoding: str
    """`cdr` or `ros1`."""
    schema_encoding: str = ""
    digest: str = ""
    """MD5 of the definition (ROS 1)."""

    @classmethod
    def of_mcap(cls, channel: Channel, schema: Schema | None) -> LogTopic:
        """Topic of an MCAP channel."""
        return cls(
            channel.topic,
            schema.name if schema else "",
            schema.data.decode(errors="replace") if schema else "",
            channel.message_encoding,
            schema.encoding if schema else "",
        )

    @classmethod
    def of_bag(cls, head: dict[bytes, bytes], details: dict[bytes, bytes]) -> LogTopic:
        """Topic of a bag's connection: fields of its record's header and data."""
        return cls(
            head[b"topic"].decode(),
            _ros2_name(details[b"type"].decode()),
            details[b"message_definition"].decode(errors="replace"),
            "ros1",
            "ros1msg",
            details[b"md5sum"].decode(),
        )


class LogRecord(NamedTuple):
    """One message of a log."""

    topic: LogTopic
    time_ns: int
    data: bytes
    sequence: int


@dataclass
class LogWalk:
    """Iterate over it for the messages; afterwards `trouble` says what was wrong, if anything."""

    path: Path
    trouble: str = ""
    damaged_chunks: int = 0
    _topics: dict[int, LogTopic] = field(default_factory=dict)

    def __iter__(self) -> Iterator[LogRecord]:
        with self.path.open("rb") as file:
            yield from _WALKS[log_format(self.path)](self, file)
        if self.damaged_chunks:
            noun = "chunk" if self.damaged_chunks == 1 else "chunks"
            damage = f"{self.damaged_chunks} damaged {noun} left out"
            self.trouble = f"{self.trouble}; {damage}" if self.trouble else damage

    def _mcap(self, file: BinaryIO) -> Iterator[LogRecord]:
        size = self.path.stat().st_size
        position = len(MCAP_MAGIC)
        schemas: dict[int, Schema] = {}
        while True:
            file.seek(position)
            head = file.read(9)
            if len(head) < 9:
                self.trouble = CUT_OFF
                return
            opcode, length = struct.unpack("<BQ", head)
            position += 9 + length
            if position > size:
                self.trouble = PART_CHUNK
                return
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                file.seek(size - len(MCAP_MAGIC))
                if file.read() != MCAP_MAGIC:
                    self.trouble = CUT_OFF
                return
            if opcode in (Opcode.CHUNK, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                try:
                    records = mcap_records(opcode, file.read(length))
                except Exception:  # whatever a decoder makes of damaged bytes
                    self.damaged_chunks += 1
                    continue
                yield from self._mcap_messages(records, schemas)

    def _mcap_messages(self, records: list[Any], schemas: dict[int, Schema]) -> Iterator[LogRecord]:
        for record in records:
            if isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                schema = schemas.get(record.schema_id)
                self._topics[record.id] = LogTopic.of_mcap(record, schema)
            elif isinstance(record, Message) and record.channel_id in self._topics:
                topic = self._topics[record.channel_id]
                yield LogRecord(topic, record.log_time, record.data, record.sequence)

    def _bag(self, file: BinaryIO) -> Iterator[LogRecord]:
        size = self.path.stat().st_size
        file.seek(len(BAG_MAGIC))
        index = BagIndex()
        while file.tell() < size:
            record = _bag_record(file, size)
            if record is None:
                self.trouble = PART_CHUNK
                return
            head, data = record
            index.pass_record(head)
            if head.get(b"op") == b"\x05":
                try:
                    chunk = decompressors[head[b"compression"].decode()](data)
                    messages = list(self._bag_messages(chunk))
                except Exception:  # whatever a decoder makes of damaged bytes
                    self.damaged_chunks += 1
                    continue
                yield from messages
        if not index.is_whole:
            self.trouble = CUT_OFF

    def _bag_messages(self, chunk: bytes) -> Iterator[LogRecord]:
        inner = io.BytesIO(chunk)
        while (record := _bag_record(inner, len(chunk))) is not None:
            head, data = record
            if head[b"op"] == b"\x07":
                (number,) = struct.unpack("<I", head[b"conn"])
                self._topics[number] = LogTopic.of_bag(head, bag_fields(data))
            elif head[b"op"] == b"\x02":
                (number,) = struct.unpack("<I", head[b"conn"])
                seconds, nanoseconds = struct.unpack("<II", head[b"time"])
                time_ns = seconds * 1_000_000_000 + nanoseconds
                yield LogRecord(self._topics[number], time_ns, data, 0)


class BagIndex:
    """Finds out whether a bag's index is there and has a record of every chunk."""

    def __init__(self) -> None:
        self._is_begun = False
        self._missing = 0

    def pass_record(self, fields: dict[bytes, bytes]) -> None:
        """Takes the header fields of the next record of the file."""
        kind = fields.get(b"op")
        if kind == b"\x03":
            self._is_begun = any(fields.get(b"index_pos", b""))
            self._missing = int.from_bytes(fields.get(b"chunk_count", b""), "little")
        elif kind == b"\x06":
            self._missing -= 1

    @property
    def is_whole(self) -> bool:
        """Whether all of it has been passed."""
        return self._is_begun and self._missing <= 0


_WALKS = {"mcap": LogWalk._mcap, "bag": LogWalk._bag}


def log_format(path: Path) -> str:
    """`mcap` or `bag`, by the file's first bytes.

    Raises
    ------
    RecordingError
        There is no such file, or it is no log.

    """
    try:
        with path.open("rb") as file:
            start = file.read(len(BAG_MAGIC))
    except OSError as error:
        raise RecordingError(f"{path}: cannot read the log: {error.strerror}") from None
    if not start:
        raise RecordingError(f"{path}: the file is empty")
    if start.startswith(MCAP_MAGIC):
        return "mcap"
    if start == BAG_MAGIC:
        return "bag"
    if BAG_MAGIC.startswith(start) or MCAP_MAGIC.startswith(start):
        raise RecordingError(f"{path}: cut off in its first {len(start)} bytes")
    raise RecordingError(f"{path}: neither an MCAP log nor a ROS 1 bag (version 2.0)")


def mcap_records(opcode: int, data: bytes) -> list[Any]:
    """The record of an opcode, those in it where it is a chunk."""
    stream = ReadDataStream(io.BytesIO(data))
    if opcode == Opcode.CHUNK:
        return breakup_chunk(Chunk.read(stream), validate_crc=True)
    if opcode == Opcode.SCHEMA:
        return [Schema.read(stream)]
    if opcode == Opcode.CHANNEL:
        return [Channel.read(stream)]
    return [Message.read(stream, len(data))]


def _bag_record(file: BinaryIO, size: int) -> tuple[dict[bytes, bytes], bytes] | None:
    """Header fields and data of the next record; None at the end or where it is not whole.

    size: bytes of the whole file. A read of more would claim memory for all that a length says.
    """
    parts = []
    for _ in range(2):
        head = file.read(4)
        if len(head) < 4:
            return None
        (length,) = struct.unpack("<I", head)
        if length > size - file.tell():
            return None
        parts.append(file.read(length))
    return bag_fields(parts[0]), parts[1]


def bag_fields(data: bytes) -> dict[bytes, bytes]:
    """The fields of a record's header."""
    fields: dict[bytes, bytes] = {}
    position = 0
    while position + 4 <= len(data):
        (length,) = struct.unpack_from("<I", data, position)
        name, _, value = data[position + 4 : position + 4 + length].partition(b"=")
        fields[name] = value
        position += 4 + length
    return fields


def _ros2_name(name: str) -> str:
    package, _, short = name.partition("/")
    return name if short.startswith("msg/") else f"{package}/msg/{short}"
