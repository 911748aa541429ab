"""Reads one SQLite file of a ROS 2 bag, with tables of any version, whole, truncated or damaged."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Set
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from volery.bridges.logs.budgets import MAX_CHUNK_BYTES, MAX_TIME_NS, TopicBudget
from volery.bridges.logs.records import LogRecord, LogTopic
from volery.core.errors import RecordingError

_TABLES = ("messages", "topics", "message_definitions", "metadata", "schema")
_IS_TIME = f"typeof(timestamp) = 'integer' AND timestamp BETWEEN 0 AND {MAX_TIME_NS}"


class SqliteFile:
    """One file of a bag: its topics with numbers of messages, and its records.

    Raises `RecordingError` if the file is no bag, or views stand in for its tables, which can
    generate endless rows.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problem = ""
        """Damage of the file as far as it was read; empty for a whole one."""
        self.topics: dict[int, LogTopic] = {}
        self.counts: dict[int, int] = {}
        """Number of messages by topic."""
        self.start_ns, self.end_ns = MAX_TIME_NS, 0
        try:
            with closing(self._open()) as base:
                _check_tables(path, base)
                self.topics = _topics(path, base)
                self._count(base)
        except UnicodeDecodeError:  # in the text of SQLite's own error
            raise RecordingError(
                f"{path}: the tables are damaged; this is no bag of ROS 2"
            ) from None
        except sqlite3.Error as error:
            raise RecordingError(f"{path}: cannot be read as a ROS 2 bag: {error}") from None

    def records(
        self, topics: Set[str] | None, start_ns: int | None, end_ns: int | None
    ) -> Iterator[LogRecord]:
        """Yields the records of `topics` (None: all), from `start_ns` to before `end_ns`.

        In the order of their times; those of a damaged file in the order of the file.
        """
        wanted = {k for k, topic in self.topics.items() if topics is None or topic.topic in topics}
        first, last = start_ns or 0, MAX_TIME_NS + 1 if end_ns is None else end_ns
        with closing(self._open()) as base:
            if self.problem:
                rows = _rows_before_damage(base)
                rows = (row for row in rows if row[0] in wanted and first <= row[1] < last)
            else:
                rows = base.execute(
                    f"SELECT topic_id, timestamp, data FROM messages WHERE {_IS_TIME} AND topic_id"
                    f" IN ({','.join('?' * len(wanted))}) AND timestamp >= ? AND timestamp < ?"
                    " ORDER BY timestamp, id",
                    (*wanted, first, last),
                )
            for topic, time_ns, data in rows:
                if isinstance(data, bytes):
                    yield LogRecord(self.topics[topic], time_ns, data, 0)

    def _open(self) -> sqlite3.Connection:
        base = sqlite3.connect(f"{self._path.resolve().as_uri()}?mode=ro&immutable=1", uri=True)
        base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_CHUNK_BYTES)
        base.text_factory = lambda text: text.decode(errors="replace")
        base.execute("PRAGMA writable_schema = 1")  # opens a file that lacks pages at its end
        return base

    def _count(self, base: sqlite3.Connection) -> None:
        try:
            found = base.execute(
                "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages WHERE"
                f" {_IS_TIME} GROUP BY topic_id"
            ).fetchall()
            for row in found:
                self._add(*row)
        except sqlite3.DatabaseError as error:
            self.problem = f"{self._path.name} is cut off or damaged, the rest is not read: {error}"
            for topic, time_ns, _ in _rows_before_damage(base):
                self._add(topic, 1, time_ns, time_ns)

    def _add(self, topic: int, count: int, first_ns: int, last_ns: int) -> None:
        if topic in self.topics:
            self.counts[topic] = self.counts.get(topic, 0) + count
            self.start_ns, self.end_ns = min(self.start_ns, first_ns), max(self.end_ns, last_ns)


def _rows_before_damage(base: sqlite3.Connection) -> Iterator[tuple[int, int, Any]]:
    """Yields topic, time and data of the messages of a damaged file, in its order."""
    query = (
        f"SELECT topic_id, timestamp, data FROM messages NOT INDEXED WHERE {_IS_TIME} ORDER BY id"
    )
    with suppress(sqlite3.DatabaseError):
        yield from base.execute(query)


def _check_tables(path: Path, base: sqlite3.Connection) -> None:
    """Raises `RecordingError` unless topics and messages are plain tables."""
    marks = ",".join("?" * len(_TABLES))
    odd = base.execute(
        f"SELECT name FROM sqlite_master WHERE name COLLATE NOCASE IN ({marks})"
        " AND (type != 'table' OR sql LIKE '%VIRTUAL%' OR sql LIKE '%GENERATED%')",
        _TABLES,
    ).fetchone()
    if odd:
        raise RecordingError(f"{path}: '{odd[0]}' is no plain table; this is no bag of ROS 2")
    for table in ("topics", "messages"):
        if not _columns(base, table):
            raise RecordingError(f"{path}: has no table '{table}'; this is no bag of ROS 2")


def _topics(path: Path, base: sqlite3.Connection) -> dict[int, LogTopic]:
    definitions: dict[str, tuple[str, str]] = {}
    if _columns(base, "message_definitions"):
        rows = base.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        )
        definitions = {name: (str(form), str(text)) for name, form, text in rows}
    coding = (
        "serialization_format" if "serialization_format" in _columns(base, "topics") else "'cdr'"
    )
    budget = TopicBudget(path)
    topics = {}
    for number, name, msgtype, encoding in base.execute(
        f"SELECT id, name, type, {coding} FROM topics ORDER BY id"
    ):
        form, text = definitions.get(msgtype, ("", ""))
        budget.spend(len(text))
        topics[number] = LogTopic(str(name), str(msgtype), text, str(encoding), form)
    return topics


def _columns(base: sqlite3.Connection, table: str) -> set[str]:
    return {row[1] for row in base.execute(f"PRAGMA table_info({table})")}
