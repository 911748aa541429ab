"""Reads ROS 2 bags, a folder or one of its files, within the limits for logs."""

from __future__ import annotations

from collections.abc import Iterator, Set
from pathlib import Path
from typing import NamedTuple

from volery.bridges.logs.bag_files import BagFiles, bag_size
from volery.bridges.logs.budgets import UnpackingBudget
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.records import LogRecord, LogWalk
from volery.bridges.logs.sqlite_file import SqliteFile
from volery.core.errors import RecordingError


class BagIndex(NamedTuple):
    """The contents of a bag of SQLite files: types and numbers of messages by topic, times, ns."""

    types: dict[str, str]
    counts: dict[str, int]
    start_ns: int
    end_ns: int
    problem: str = ""
    """What is missing or not read; empty for a whole bag."""


def bag_topics(path: Path) -> dict[str, str]:
    """Returns types by topic. Raises `RecordingError` if there is no bag or it exceeds limits."""
    with BagFiles(path) as files:
        if files.mcap:
            return {t.topic: t.msgtype for part in files.mcap for t in summarize(part).topics}
        return sqlite_index(files).types


def sqlite_index(files: BagFiles) -> BagIndex:
    """Returns the contents of a bag of SQLite files.

    Raises `RecordingError` if none of them is a bag or it exceeds limits.
    """
    found: list[SqliteFile] = []
    problems = [files.problem] if files.problem else []
    for part in files.sqlite:
        try:
            found.append(SqliteFile(part))
        except RecordingError as error:
            if len(files.sqlite) == 1:
                raise
            problems.append(str(error))
    if not found:
        raise RecordingError(problems[-1])
    types: dict[str, str] = {}
    counts: dict[str, int] = {}
    for file in found:
        for number, topic in file.topics.items():
            types[topic.topic] = topic.msgtype
            counts[topic.topic] = counts.get(topic.topic, 0) + file.counts.get(number, 0)
    filled = [file for file in found if file.counts]
    start_ns = min((file.start_ns for file in filled), default=0)
    end_ns = max((file.end_ns for file in filled), default=0)
    problems += [file.problem for file in found if file.problem]
    return BagIndex(types, counts, start_ns, end_ns, "; ".join(problems))


def sqlite_records(
    files: BagFiles, size: int, topics: Set[str] | None, start_ns: int, end_ns: int | None
) -> Iterator[LogRecord]:
    """Yields the records of a bag's SQLite files, file by file.

    size: bytes of the bag. topics: None for all. Raises `RecordingError` beyond the limits of logs.
    """
    budget = UnpackingBudget(files.sqlite[0], size)
    for part in files.sqlite:
        try:
            file = SqliteFile(part)
        except RecordingError:
            continue  # named by `sqlite_index`
        for record in file.records(topics, start_ns, end_ns):
            budget.spend(len(record.data))
            yield record


class BagWalk:
    """Iterates over the records of a ROS 2 bag; afterwards `problem` describes any damage."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problem = ""

    def __iter__(self) -> Iterator[LogRecord]:
        with BagFiles(self._path) as files:
            self.problem = files.problem
            for part in files.mcap:
                walk = LogWalk(part)
                yield from walk
                self.problem = self.problem or walk.problem
            if not files.mcap:
                self.problem = sqlite_index(files).problem
                yield from sqlite_records(files, bag_size(self._path), None, 0, None)
