"""Reads the records of selected topics from a ROS 2 bag of SQLite files."""

from __future__ import annotations

from collections.abc import Iterator, Set
from pathlib import Path

from volery.bridges.logs.records import LogRecord
from volery.bridges.logs.ros2_bags import BagWalk, sqlite_index
from volery.logs.topic_count import TopicCount


class SqliteSource:
    """Reads a bag's folder or its SQLite file; see `LogSource`.

    Raises `RecordingError` if there is no bag or it exceeds the limits of logs.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        index = sqlite_index(path)
        self.problem = index.problem
        self.start_ns, self.end_ns = index.start_ns, index.end_ns
        self.topics = {
            name: TopicCount(msgtype, index.counts[name])
            for name, msgtype in sorted(index.types.items())
        }

    def records(self, topics: Set[str], start_ns: int, end_ns: int) -> Iterator[LogRecord]:
        """Yields the records of `topics` from `start_ns` to before `end_ns`."""
        walk = BagWalk(self._path, topics, start_ns, end_ns)
        yield from walk
        if walk.problem not in self.problem:
            self.problem = "; ".join(filter(None, (self.problem, walk.problem)))

    def close(self) -> None:
        """Does nothing: the file is opened for each reading."""
