"""Reads ROS 2 bags, a folder or its SQLite file, within the limits for logs.

MCAP files in a bag's folder are read as any MCAP; SQLite files by `rosbags`, after a check of their
contents.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterable, Iterator, Set
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

from volery.bridges.logs.budgets import MAX_CHUNK_BYTES, UnpackingBudget
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.records import LogRecord, LogTopic, LogWalk
from volery.core.errors import RecordingError

_PACKED = re.compile(r"compression_mode\W+(file|message)", re.IGNORECASE)
_MCAP = re.compile(r"storage_identifier\W+mcap", re.IGNORECASE)
_FORMS = {"msg": "ros2msg", "idl": "ros2idl"}
_METADATA = "metadata.yaml"
_TABLES = ("messages", "topics", "message_definitions", "metadata", "schema")


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
    if parts := mcap_parts(path):
        return {t.topic: t.msgtype for part in parts for t in summarize(part).topics}
    return sqlite_index(path).types


def sqlite_index(path: Path) -> BagIndex:
    """Returns the contents of a bag of SQLite files.

    Raises `RecordingError` if there is no bag or it exceeds limits.
    """
    _check_metadata(path)
    parts = _sqlite_parts(path)
    _check_files(path)
    found = []
    problems = [_missing(path, parts)]
    for part in parts:
        try:
            found.append(_part_index(part))
        except RecordingError as error:
            if len(parts) == 1:
                raise
            problems.append(str(error))
    if not found:
        raise RecordingError(f"{path}: {problems[-1]}")
    types: dict[str, str] = {}
    counts: dict[str, int] = {}
    for index in found:
        types.update(index.types)
        for topic, count in index.counts.items():
            counts[topic] = counts.get(topic, 0) + count
    filled = [index for index in found if sum(index.counts.values())]
    start_ns = min((index.start_ns for index in filled), default=0)
    end_ns = max((index.end_ns for index in filled), default=0)
    return BagIndex(types, counts, start_ns, end_ns, "; ".join(filter(None, problems)))


def _part_index(path: Path) -> BagIndex:
    """Returns the contents of one SQLite file, or of a folder with metadata."""
    from rosbags.rosbag2 import Reader

    try:
        with Reader(path) as reader:
            counts: dict[str, int] = {}
            for one in reader.connections:
                counts[one.topic] = counts.get(one.topic, 0) + one.msgcount
            types = {one.topic: one.msgtype for one in reader.connections}
            if not sum(counts.values()):
                return BagIndex(types, counts, 0, 0)
            return BagIndex(types, counts, reader.start_time, reader.end_time - 1)
    except Exception as error:  # the reader's errors on a folder that is no bag
        raise RecordingError(f"{path}: cannot be read as a ROS 2 bag: {error}") from None


class BagWalk:
    """Iterates over the records of a ROS 2 bag; afterwards `problem` describes any damage."""

    def __init__(
        self,
        path: Path,
        topics: Set[str] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
    ) -> None:
        """Selects the records of `topics` (None: all), from `start_ns` to before `end_ns`.

        The selection applies to SQLite files.
        """
        self._path = path
        self._topics, self._range_ns = topics, (start_ns, end_ns)
        self.problem = ""

    def __iter__(self) -> Iterator[LogRecord]:
        parts = mcap_parts(self._path)
        for part in parts:
            walk = LogWalk(part)
            yield from walk
            self.problem = self.problem or walk.problem
        if not parts:
            yield from self._sqlite()

    def _sqlite(self) -> Iterator[LogRecord]:
        budget = UnpackingBudget(self._path, bag_size(self._path))
        for part in _sqlite_parts(self._path):
            try:
                yield from self._sqlite_part(part, budget)
            except RecordingError:
                raise
            except Exception as error:  # the reader's errors on damaged bytes
                self.problem = self.problem or f"cut off or damaged: {error}"

    def _sqlite_part(self, path: Path, budget: UnpackingBudget) -> Iterator[LogRecord]:
        from rosbags.rosbag2 import Reader

        topics: dict[int, LogTopic] = {}
        with Reader(path) as reader:
            chosen = [
                one
                for one in reader.connections
                if self._topics is None or one.topic in self._topics
            ]
            if not chosen:
                return
            for connection, time_ns, data in reader.messages(chosen, *self._range_ns):
                budget.spend(len(data))
                if connection.id not in topics:
                    topics[connection.id] = _topic(connection)
                yield LogRecord(topics[connection.id], time_ns, bytes(data), 0)


def _topic(connection: Any) -> LogTopic:
    form = _FORMS.get(connection.msgdef.format.name.lower(), "")
    definition = connection.msgdef.data
    return LogTopic(connection.topic, connection.msgtype, definition, "cdr", form)


def mcap_parts(path: Path) -> list[Path]:
    """Returns the MCAP files of a bag's folder in order: `x_0.mcap` to `x_10.mcap`.

    Empty if `path` is a file, or a folder without any.
    """
    return _in_order(path.glob("*.mcap")) if path.is_dir() else []


def _sqlite_parts(path: Path) -> list[Path]:
    """Returns what `rosbags` reads one by one: a file, a folder with metadata, or its SQLite files.

    A recorder that is killed leaves a folder without `metadata.yaml`. Raises `RecordingError` if
    the folder has no SQLite files either.
    """
    if not path.is_dir() or (path / _METADATA).exists():
        return [path]
    parts = _in_order(path.glob("*.db3"))
    if not parts:
        raise RecordingError(f"{path}: the folder holds no {_METADATA}, no .mcap and no .db3 file")
    return parts


def _in_order(parts: Iterable[Path]) -> list[Path]:
    return sorted(parts, key=lambda part: (len(part.name), part.name))


def _missing(path: Path, parts: list[Path]) -> str:
    """Returns what a bag lacks: its metadata, or messages that SQLite has not moved to its file."""
    found = []
    if parts != [path]:
        found.append(f"{_METADATA} is missing; read without it: {', '.join(p.name for p in parts)}")
    files = _in_order(path.glob("*.db3")) if path.is_dir() else [path]
    for file in files:
        rest = file.with_name(f"{file.name}-wal")
        if rest.is_file() and rest.stat().st_size:
            found.append(
                f"{rest.name} holds messages that are not read; `sqlite3 {file.name} VACUUM` in "
                "this folder moves them"
            )
    return "; ".join(found)


def bag_size(path: Path) -> int:
    """Returns the size of a file, or of a folder's files together, bytes."""
    files = path.iterdir() if path.is_dir() else (path,)
    return sum(file.stat().st_size for file in files if file.is_file())


def _check_metadata(path: Path) -> None:
    """Refuses what `rosbags` would decompress without limit: compressed files, renamed MCAP."""
    try:
        text = (path / _METADATA).read_text(encoding="utf-8") if path.is_dir() else ""
    except (OSError, UnicodeDecodeError):
        return  # the reader reports the reason
    if _PACKED.search(text) or _MCAP.search(text):
        raise RecordingError(
            f"{path}: is compressed, or of files that are not named .mcap; `ros2 bag convert` "
            "writes it so that it can be read here"
        )


def _check_files(path: Path) -> None:
    """Refuses SQLite files with views in place of tables: a view can generate endless rows."""
    for file in path.glob("*.db3") if path.is_dir() else (path,):
        try:
            with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro", uri=True)) as base:
                base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_CHUNK_BYTES)
                marks = ",".join("?" * len(_TABLES))
                odd = base.execute(
                    f"SELECT name FROM sqlite_master WHERE name COLLATE NOCASE IN ({marks})"
                    " AND (type != 'table' OR sql LIKE '%VIRTUAL%' OR sql LIKE '%GENERATED%')",
                    _TABLES,
                ).fetchone()
        except sqlite3.Error:
            continue  # the reader reports the reason
        except UnicodeDecodeError:  # in the text of SQLite's own error
            raise RecordingError(
                f"{file}: the tables are damaged; this is no bag of ROS 2"
            ) from None
        if odd:
            raise RecordingError(f"{file}: '{odd[0]}' is no plain table; this is no bag of ROS 2")
