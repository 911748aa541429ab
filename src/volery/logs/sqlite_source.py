"""Reads the records of selected topics from a ROS 2 bag of SQLite files."""

from __future__ import annotations

from collections.abc import Iterator, Set
from pathlib import Path

from volery.bridges.logs.bag_files import BagFiles, bag_size
from volery.bridges.logs.records import LogRecord
from volery.bridges.logs.ros2_bags import sqlite_index, sqlite_records
from volery.core.errors import RecordingError
from volery.logs.topic_count import TopicCount


class SqliteSource:
    """Reads the SQLite files of a bag; see `LogSource`. Closes `files` with itself.

    Raises `RecordingError` if none of them is a bag or it exceeds the limits of logs.
    """

    def __init__(self, path: Path, files: BagFiles) -> None:
        self._path, self._files = path, files
        self._is_closed = False
        index = sqlite_index(files)
        self.problem = index.problem
        self.start_ns, self.end_ns = index.start_ns, index.end_ns
        self.topics = {
            name: TopicCount(msgtype, index.counts[name])
            for name, msgtype in sorted(index.types.items())
        }

    def records(self, topics: Set[str], start_ns: int, end_ns: int) -> Iterator[LogRecord]:
        """Yields the records of `topics` from `start_ns` to before `end_ns`."""
        if self._is_closed:
            raise RecordingError(f"{self._path}: the log is closed; open it again")
        yield from sqlite_records(self._files, bag_size(self._path), topics, start_ns, end_ns)

    def close(self) -> None:
        """Removes unpacked files."""
        self._is_closed = True
        self._files.close()
