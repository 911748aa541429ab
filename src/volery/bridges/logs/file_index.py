"""Reads the index at a log's end: topics, counts and times, without reading the messages.

A whole file ends with an index. If the index is missing, damaged or too large, the reader scans the
file.
"""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Schema, Statistics

from volery.bridges.logs import bag_format, mcap_format
from volery.bridges.logs.bag_format import BagIndex, bag_fields
from volery.bridges.logs.budgets import (
    MAX_HEAD_BYTES,
    MAX_INDEX_BYTES,
    MAX_TIME_NS,
    TopicBudget,
)
from volery.bridges.logs.records import BAG_MAGIC, MCAP_MAGIC, LogTopic
from volery.core.errors import RecordingError

Counts = dict[tuple[str, str], int]
"""Messages by topic and type."""

_FOOTER_BYTES = 29
"""Size of an MCAP's last record: its head, two positions and a checksum."""
_PAIR = struct.Struct("<II")


def mcap_index(path: Path, counts: Counts) -> tuple[int, int] | None:
    """Returns first and last time of an MCAP's messages and fills `counts`.

    None without an index.
    """
    with path.open("rb") as file:
        try:
            return _mcap_statistics(file, path, counts)
        except RecordingError:
            raise
        except Exception:  # any error of the records' reader on damaged bytes
            return None


def bag_index(path: Path, counts: Counts) -> tuple[int, int] | None:
    """Returns first and last time of a bag's messages and fills `counts`; None without an index."""
    with path.open("rb") as file:
        try:
            return _bag_statistics(file, path, counts)
        except ValueError:
            return None


def _mcap_statistics(file: BinaryIO, path: Path, counts: Counts) -> tuple[int, int] | None:
    size = os.fstat(file.fileno()).st_size
    end = size - len(MCAP_MAGIC) - _FOOTER_BYTES
    if end < len(MCAP_MAGIC):
        return None
    file.seek(end)
    tail = file.read()
    if tail[-len(MCAP_MAGIC) :] != MCAP_MAGIC or tail[0] != Opcode.FOOTER:
        return None
    start = Footer.read(ReadDataStream(io.BytesIO(tail[mcap_format.HEAD.size :]))).summary_start
    if not 0 < end - start <= MAX_INDEX_BYTES or start < len(MCAP_MAGIC):
        return None
    file.seek(start)
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    numbers: Statistics | None = None
    budget = TopicBudget(path)
    for opcode, data in _mcap_records(file.read(end - start)):
        if opcode in mcap_format.DEFINITIONS:
            budget.spend(len(data))
            record = mcap_format.definition(opcode, data)
            if isinstance(record, Schema):
                schemas[record.id] = record
            else:
                channels[record.id] = record
        elif opcode == Opcode.STATISTICS:
            numbers = Statistics.read(ReadDataStream(io.BytesIO(data)))
    if numbers is None or not _is_complete(numbers, channels):
        return None
    found = numbers.channel_message_counts
    for number, channel in channels.items():
        topic = LogTopic.of_mcap(channel, schemas.get(channel.schema_id))
        key = (topic.topic, topic.msgtype)
        counts[key] = counts.get(key, 0) + found.get(number, 0)
    return numbers.message_start_time, numbers.message_end_time


def _is_complete(numbers: Statistics, channels: Mapping[int, Channel]) -> bool:
    """Returns whether times are valid and all messages are counted.

    Writers may leave out counts and channels.
    """
    counts = numbers.channel_message_counts
    if not 0 <= numbers.message_start_time <= numbers.message_end_time <= MAX_TIME_NS:
        return False
    return sum(counts.values()) == numbers.message_count and counts.keys() <= channels.keys()


def _mcap_records(data: bytes) -> Iterator[tuple[int, bytes]]:
    position = 0
    while position + mcap_format.HEAD.size <= len(data):
        opcode, length = mcap_format.HEAD.unpack_from(data, position)
        body = position + mcap_format.HEAD.size
        position = body + length
        yield opcode, data[body:position]


def _bag_statistics(file: BinaryIO, path: Path, counts: Counts) -> tuple[int, int] | None:
    size = os.fstat(file.fileno()).st_size
    file.seek(len(BAG_MAGIC))
    head = file.read(4)
    length = int.from_bytes(head, "little")
    if len(head) < 4 or length > MAX_HEAD_BYTES:
        return None
    header = bag_fields(file.read(length))
    start = int.from_bytes(header.get(b"index_pos", b""), "little")
    if not 0 < start <= size or size - start > MAX_INDEX_BYTES:
        return None
    file.seek(start)
    data = file.read(size - start)
    topics: dict[int, tuple[str, str]] = {}
    times: list[int] = []
    index = BagIndex()
    index.pass_record(header)
    budget = TopicBudget(path)
    position = 0
    while position < len(data):
        fields, begin, position = bag_format.inner_record(data, position)
        index.pass_record(fields)
        kind = fields.get(b"op")
        if kind == bag_format.CONNECTION:
            budget.spend(position - begin)
            topic = LogTopic.of_bag(fields, data[begin:position])
            key = topics[bag_format.number(fields, b"conn")] = (topic.topic, topic.msgtype)
            counts.setdefault(key, 0)
        elif kind == bag_format.CHUNK_INFO and bag_format.number(fields, b"count"):
            times += [bag_format.time_ns(fields, name) for name in (b"start_time", b"end_time")]
            pairs = data[begin : position - (position - begin) % _PAIR.size]
            for connection, messages in _PAIR.iter_unpack(pairs):
                if connection not in topics:
                    raise ValueError("a chunk's index names an unknown connection")
                counts[topics[connection]] += messages
    if not index.is_whole:
        return None
    return (min(times), max(times)) if times else (0, 0)
