"""Reads the records of a log, whole or truncated, without its index.

A killed run leaves a file without its tail. Its chunks are consecutive, each with its length, so
they can be read until the file ends within one.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from volery.bridges.logs import bag_format, mcap_format
from volery.bridges.logs.bag_format import BagIndex, bag_fields
from volery.bridges.logs.budgets import (
    MAX_CHUNK_BYTES,
    MAX_HEAD_BYTES,
    TopicBudget,
    UnpackingBudget,
)
from volery.bridges.logs.content import Content, DamageCount
from volery.core.errors import RecordingError

MCAP_MAGIC = b"\x89MCAP0\r\n"
BAG_MAGIC = b"#ROSBAG V2.0\n"

_MARKS = {
    MCAP_MAGIC: "mcap",
    BAG_MAGIC: "bag",
    b"#ROSBAG V1": "bag 1",
    b"ULogEnc": "encrypted ulog",
    b"ULog": "ulog",
    b"SQLite format 3\0": "sqlite",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\x1f\x8b": "gzip",
    b"BZh": "bzip2",
    b"\xfd7zXZ\0": "xz",
    b"PK\x03\x04": "zip",
    b"\xa3\x95": "dataflash",
}
"""Formats by the first bytes of a file."""
_MARK_BYTES = 16
_HINTS = {
    "bag 1": "; it is a bag of an older version: `rosbag filter OLD NEW True` of ROS 1 converts it",
    "ulog": "; it is a ULog, which `open_log` and `volery info` read",
    "encrypted ulog": "; it is an encrypted log of PX4 (Log Encryption), whose tools decrypt it",
    "sqlite": "; it is a file of a ROS 2 bag, which `open_log`, `volery info` and `play` read",
    **{
        kind: f"; it is compressed by {kind}: `{tool}` unpacks it"
        for kind, tool in (
            ("zstd", "zstd -d"),
            ("gzip", "gunzip"),
            ("bzip2", "bunzip2"),
            ("xz", "unxz"),
            ("zip", "unzip"),
        )
    },
    "dataflash": "; it is a dataflash log of ArduPilot, which is not read",
}
"""What a file of another format is, and what reads it."""

CUT_OFF = "cut off: the index at its end is missing"


def cut_at(position: int) -> str:
    """Returns the problem of a file that ends within the record at a byte."""
    return f"cut off in the middle of a chunk, which begins at byte {position}"


@dataclass(frozen=True)
class LogTopic:
    """A topic as the log describes it."""

    topic: str
    msgtype: str
    """Name in ROS 2 style, `sensor_msgs/msg/LaserScan`."""
    definition: str
    """Text of the schema; bytes that are not UTF-8 as surrogates."""
    encoding: str
    """`cdr`, `ros1`, or another one that is not decoded."""
    schema_encoding: str = ""
    digest: str = ""
    """MD5 of the definition (ROS 1)."""

    @classmethod
    def of_mcap(cls, channel: Channel, schema: Schema | None) -> LogTopic:
        """Returns the topic of an MCAP channel."""
        return cls(
            channel.topic,
            schema.name if schema else "",
            schema.data.decode(errors="surrogateescape") if schema else "",
            channel.message_encoding,
            schema.encoding if schema else "",
        )

    @classmethod
    def of_bag(cls, head: dict[bytes, bytes], data: bytes) -> LogTopic:
        """Returns the topic of a bag's connection from fields and data of its record.

        Raises `ValueError` if the record is invalid.
        """
        details = bag_fields(data)
        try:
            return cls(
                head[b"topic"].decode(),
                _ros2_name(details[b"type"].decode()),
                details[b"message_definition"].decode(errors="replace"),
                "ros1",
                "ros1msg",
                details[b"md5sum"].decode(),
            )
        except KeyError as error:
            raise ValueError(f"a connection lacks its field {error}") from None


class LogRecord(NamedTuple):
    """One message of a log."""

    topic: LogTopic
    time_ns: int
    data: bytes
    sequence: int


@dataclass
class LogWalk:
    """Iterates over the messages of a log; afterwards `problem` describes any damage.

    Iterating raises `RecordingError` if the file describes or unpacks to more than the limits.
    """

    path: Path
    problem: str = ""
    damage: DamageCount = field(default_factory=DamageCount)
    _topics: dict[int, LogTopic] = field(default_factory=dict)
    _schemas: dict[int, Schema] = field(default_factory=dict)

    def __iter__(self) -> Iterator[LogRecord]:
        size = self.path.stat().st_size
        self._unpacking, self._described = UnpackingBudget(self.path, size), TopicBudget(self.path)
        with self.path.open("rb") as file:
            yield from _WALKS[log_format(self.path)](self, file, size)
        parts = (self.problem, self.damage.describe())
        self.problem = "; ".join(part for part in parts if part)

    def _mcap(self, file: BinaryIO, size: int) -> Iterator[LogRecord]:
        position = len(MCAP_MAGIC)
        while True:
            file.seek(position)
            head = file.read(mcap_format.HEAD.size)
            if len(head) < mcap_format.HEAD.size:
                self.problem = CUT_OFF
                return
            opcode, length = mcap_format.HEAD.unpack(head)
            begin, position = position, position + mcap_format.HEAD.size + length
            if position > size:
                self.problem = cut_at(begin)
                return
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                file.seek(size - len(MCAP_MAGIC))
                if file.read() != MCAP_MAGIC:
                    self.problem = CUT_OFF
                return
            if opcode in mcap_format.READ:
                try:
                    content = self._mcap_content(opcode, _body(file, length))
                except ValueError as error:
                    self.damage.add(begin, error)
                    continue
                yield from self._records(content)

    def _mcap_content(self, opcode: int, data: bytes) -> Content:
        if opcode in mcap_format.DEFINITIONS:
            self._learn(opcode, data)
            return Content()
        if opcode == Opcode.MESSAGE:
            return Content((mcap_format.message_head(data, 0, len(data)),), data)
        unpacked = mcap_format.unpack_chunk(memoryview(data))
        self._unpacking.spend(len(unpacked))
        return mcap_format.chunk_content(unpacked, self._learn)

    def _learn(self, opcode: int, data: bytes) -> None:
        record = mcap_format.definition(opcode, data)
        if isinstance(record, Schema):
            self._described.spend(len(record.data))
            self._schemas[record.id] = record
        else:
            self._described.spend(0)
            schema = self._schemas.get(record.schema_id)
            self._topics[record.id] = LogTopic.of_mcap(record, schema)

    def _bag(self, file: BinaryIO, size: int) -> Iterator[LogRecord]:
        file.seek(len(BAG_MAGIC))
        index = BagIndex()
        while (begin := file.tell()) < size:
            record = _bag_record(file, size)
            if record is None and (start := index.after_stray_bytes(begin, size)):
                file.seek(start)
                continue
            if record is None:
                self.problem = cut_at(begin)
                return
            head, data = record
            index.pass_record(head)
            if head.get(b"op") == bag_format.CHUNK:
                try:
                    content = self._bag_content(head, data)
                except ValueError as error:
                    self.damage.add(begin, error)
                    continue
                yield from self._records(content)
        if not index.is_whole:
            self.problem = CUT_OFF

    def _bag_content(self, head: dict[bytes, bytes], data: bytes) -> Content:
        unpacked = bag_format.unpack_chunk(head, data)
        self._unpacking.spend(len(unpacked))
        return bag_format.chunk_content(unpacked, self._connect)

    def _connect(self, number: int, head: dict[bytes, bytes], data: bytes) -> None:
        self._described.spend(len(data))
        self._topics[number] = LogTopic.of_bag(head, data)

    def _records(self, content: Content) -> Iterator[LogRecord]:
        for channel, time_ns, begin, end, sequence in content.heads:
            if channel in self._topics:
                data = content.data[begin:end]
                yield LogRecord(self._topics[channel], time_ns, data, sequence)


_WALKS = {"mcap": LogWalk._mcap, "bag": LogWalk._bag}


def file_signature(path: Path) -> str:
    """Returns the format that the first bytes of a file show: `mcap`, `bag`, `zstd`...

    Empty for an unknown format. Raises `RecordingError` if the file is missing, empty, or ends
    within the mark of its format.
    """
    try:
        with path.open("rb") as file:
            start = file.read(_MARK_BYTES)
    except OSError as error:
        raise RecordingError(f"{path}: cannot read the log: {error.strerror}") from None
    if not start:
        raise RecordingError(f"{path}: the file is empty")
    found = next((kind for mark, kind in _MARKS.items() if start.startswith(mark)), "")
    if not found and (BAG_MAGIC.startswith(start) or MCAP_MAGIC.startswith(start)):
        raise RecordingError(f"{path}: cut off in its first {len(start)} bytes")
    return found


def log_format(path: Path, *others: str) -> str:
    """Returns `mcap` or `bag`, by the file's first bytes.

    others: formats that the caller also reads, for the error. Raises `RecordingError` if there is
    no such file, or it is no log of these two formats.
    """
    found = file_signature(path)
    if found in _WALKS:
        return found
    *names, last = ("an MCAP log", "a ROS 1 bag (version 2.0)", *others)
    raise RecordingError(f"{path}: neither {', '.join(names)} nor {last}{_HINTS.get(found, '')}")


def _body(file: BinaryIO, length: int) -> bytes:
    """Returns the next bytes of a file. Raises `ValueError` beyond the largest record."""
    if length > MAX_CHUNK_BYTES:
        raise ValueError(f"a record of {length} bytes; at most {MAX_CHUNK_BYTES} are read")
    return file.read(length)


def _bag_record(file: BinaryIO, size: int) -> tuple[dict[bytes, bytes], bytes] | None:
    """Returns header fields and data of the next record; None at the end or if it is incomplete.

    size: bytes of the whole file. A longer read would allocate memory for any announced length. Too
    large records are skipped and returned empty.
    """
    parts: list[bytes] = []
    begin = file.tell()
    for limit in (MAX_HEAD_BYTES, MAX_CHUNK_BYTES):
        head = file.read(4)
        if len(head) < 4:
            return None
        (length,) = struct.unpack("<I", head)
        if length > size - file.tell():
            if begin > len(BAG_MAGIC) or not parts:
                return None
            length = max(begin + bag_format.FIRST_BYTES - file.tell(), 0)
        parts.append(file.read(length) if length <= limit else b"")
        if length > limit:
            file.seek(length, 1)
    return bag_fields(parts[0]), parts[1]


def _ros2_name(name: str) -> str:
    package, _, short = name.partition("/")
    return name if short.startswith("msg/") else f"{package}/msg/{short}"
