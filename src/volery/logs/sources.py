"""Reads the records of selected topics from logs of each format, without reading the others.

MCAP files and ROS 1 bags are read chunk by chunk; a ROS 2 bag is a folder of MCAP or SQLite files;
ULog is PX4's format. The first bytes of a file show its format. A file is closed with its source,
at the latest when the last user of the source ends.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Set
from pathlib import Path
from typing import Protocol

from volery.bridges.logs.bag_files import BagFiles, bag_size
from volery.bridges.logs.chunks import Chunk, ChunkedLog
from volery.bridges.logs.log_formats import open_chunks
from volery.bridges.logs.records import LogRecord, file_signature, log_format
from volery.bridges.logs.ros2_bags import sqlite_index, sqlite_records
from volery.core.errors import RecordingError
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

    def __init__(self, parts: list[ChunkedLog], files: BagFiles | None = None) -> None:
        self._parts, self._files = parts, files
        self._closing = weakref.finalize(self, _close, parts, files)
        chunks = [chunk for part in parts for chunk in part.chunks]
        self.start_ns = min((chunk.start_ns for chunk in chunks), default=0)
        self.end_ns = max((chunk.end_ns for chunk in chunks), default=0)
        self.topics = _topics_of(parts)

    @property
    def problem(self) -> str:
        """Problems of the files, as far as they were read; empty for whole ones."""
        problems = [self._files.problem if self._files else "", *(p.problem for p in self._parts)]
        return "; ".join(filter(None, problems))

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


class _SqliteSource:
    """Reads the SQLite files of a bag; see `LogSource`. Closes `files` with itself.

    Raises `RecordingError` if none of them is a bag or it exceeds the limits of logs.
    """

    def __init__(self, path: Path, files: BagFiles) -> None:
        self._path, self._files = path, files
        self._is_closed = False
        index = sqlite_index(files)
        self._problems = index.problems
        self.start_ns, self.end_ns = index.start_ns, index.end_ns
        self.topics = {
            name: TopicCount(msgtype, index.counts[name])
            for name, msgtype in sorted(index.types.items())
        }

    @property
    def problem(self) -> str:
        """Problems of the files, as far as they were read; empty for whole ones."""
        return "; ".join(self._problems)

    def records(self, topics: Set[str], start_ns: int, end_ns: int) -> Iterator[LogRecord]:
        """Yields the records of `topics` from `start_ns` to before `end_ns`."""
        if self._is_closed:
            raise RecordingError(f"{self._path}: the log is closed; open it again")
        size, range_ns = bag_size(self._path), (start_ns, end_ns)
        yield from sqlite_records(self._files, size, topics, range_ns, self._problems)

    def close(self) -> None:
        """Removes unpacked files."""
        self._is_closed = True
        self._files.close()


def open_source(path: Path) -> LogSource:
    """Opens a log of any format. Raises `RecordingError` if the file is missing or no log."""
    kind = log_kind(path)
    if kind == "ulog":
        return UlogSource(path)
    if kind != "ros2bag":
        return ChunkSource([open_chunks(path)])
    files, parts = BagFiles(path), list[ChunkedLog]()
    try:
        if not files.mcap:
            return _SqliteSource(path, files)
        parts += [open_chunks(file) for file in files.mcap]
        return ChunkSource(parts, files)
    except BaseException:
        _close(parts, files)
        raise


def log_kind(path: Path) -> str:
    """Returns `mcap`, `bag`, `ros2bag` or `ulog`, by the first bytes of a file.

    A file of another format has the kind of its suffix, whose reader says what is wrong with it.
    Raises `RecordingError` if the file is missing, or neither says what it is.
    """
    if path.is_dir():
        return "ros2bag"
    by_suffix = {".ulg": "ulog", ".db3": "ros2bag"}.get(path.suffix.lower(), "")
    found = file_signature(path)
    kind = {"sqlite": "ros2bag", "zstd": "ros2bag", "ulog": "ulog"}.get(found)
    if kind is None and not found:
        kind = by_suffix
    return kind or log_format(path, "a ROS 2 bag", "a ULog of PX4")


def _close(parts: list[ChunkedLog], files: BagFiles | None = None) -> None:
    for part in parts:
        part.close()
    if files is not None:
        files.close()


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
