"""Reads the records of selected topics from logs of each format, without reading the others.

MCAP files and ROS 1 bags are read chunk by chunk; a ROS 2 bag is a folder of MCAP files or an
SQLite file; ULog is PX4's format. A file is closed with its source, at the latest when the last
user of the source ends.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Set
from pathlib import Path
from typing import Protocol

from volery.bridges.logs.chunks import Chunk, ChunkedLog
from volery.bridges.logs.log_formats import open_chunks
from volery.bridges.logs.records import LogRecord
from volery.bridges.logs.ros2_bags import mcap_parts
from volery.core.errors import RecordingError
from volery.logs.sqlite_source import SqliteSource
from volery.logs.topic_count import TopicCount
from volery.logs.ulog_source import UlogSource


class LogSource(Protocol):
    """Reads records of a log, in the order of the file."""

    start_ns: int
    """Time of the earliest message, ns."""
    end_ns: int
    """Time of the latest message, ns."""

    topics: dict[str, TopicCount]
    """Topics by name."""

    @property
    def problem(self) -> str:
        """Problems of the file, as far as it was read; empty for a whole one."""

    def records(self, topics: Set[str], start_ns: int, end_ns: int) -> Iterator[LogRecord]:
        """Yields the records of `topics` from `start_ns` to before `end_ns`."""

    def close(self) -> None:
        """Closes the file."""


class ChunkSource:
    """Reads an MCAP file or a ROS 1 bag, or the MCAP files of one ROS 2 bag."""

    def __init__(self, parts: list[ChunkedLog]) -> None:
        self._parts = parts
        self._closing = weakref.finalize(self, _close, parts)
        chunks = [chunk for part in parts for chunk in part.chunks]
        self.start_ns = min((chunk.start_ns for chunk in chunks), default=0)
        self.end_ns = max((chunk.end_ns for chunk in chunks), default=0)
        self.topics = _topics_of(parts)

    @property
    def problem(self) -> str:
        """Problems of the files, as far as they were read; empty for whole ones."""
        return "; ".join(part.problem for part in self._parts if part.problem)

    def records(self, topics: Set[str], start_ns: int, end_ns: int) -> Iterator[LogRecord]:
        """Yields the records of `topics` from `start_ns` to before `end_ns`."""
        if not self._closing.alive:
            raise RecordingError(f"{self._parts[0].path}: the log is closed; open it again")
        for part in self._parts:
            channels = {k for k, topic in part.topics.items() if topic.topic in topics}
            for chunk in part.chunks:
                if channels.isdisjoint(chunk.counts) or _is_outside(chunk, start_ns, end_ns):
                    continue
                content = part.content(chunk)
                for head in content.heads:
                    if head.channel in channels and start_ns <= head.time_ns < end_ns:
                        yield part.record(content, head)

    def close(self) -> None:
        """Closes the files."""
        self._closing()


def open_source(path: Path) -> LogSource:
    """Opens a log of any format. Raises `RecordingError` if the file is missing or no log."""
    if path.suffix.lower() == ".ulg":
        return UlogSource(path)
    files = mcap_parts(path)
    if not files and (path.is_dir() or path.suffix.lower() == ".db3"):
        return SqliteSource(path)
    parts: list[ChunkedLog] = []
    try:
        parts += [open_chunks(file) for file in files or [path]]
        return ChunkSource(parts)
    except BaseException:
        _close(parts)
        raise


def _close(parts: list[ChunkedLog]) -> None:
    for part in parts:
        part.close()


def _topics_of(parts: list[ChunkedLog]) -> dict[str, TopicCount]:
    found: dict[str, TopicCount] = {}
    for part in parts:
        counts = part.counts()
        for channel, topic in part.topics.items():
            before = found.get(topic.topic, TopicCount(topic.msgtype, 0))
            found[topic.topic] = TopicCount(before.msgtype, before.messages + counts[channel])
    return dict(sorted(found.items()))


def _is_outside(chunk: Chunk, start_ns: int, end_ns: int) -> bool:
    """Returns whether no message of a chunk is from `start_ns` to before `end_ns`."""
    return chunk.end_ns < start_ns or chunk.start_ns >= end_ns
