"""Reads the selected messages of a log one by one, with a seek."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from volery.bridges.logs.records import LogRecord, LogWalk, log_format
from volery.core.errors import RecordingError


class LogStream:
    """Reads a log forward, a chunk in memory at a time; a backward `seek` starts again.

    Raises `RecordingError` if there is no log; a damaged one is read as far as possible, and
    `problem` describes the damage.
    """

    def __init__(self, path: Path, wants: Callable[[str], bool]) -> None:
        log_format(path)
        self.path = path
        self.problem = ""
        self.index = 0
        """Number of the record that `peek` returns, counting unselected ones."""
        self.first_ns = 0
        """Time of the log's first record, selected or not; known after the first `peek`."""
        self.last_ns = 0
        """Latest time of the selected records returned so far."""
        self.selected = 0
        """Number of selected records returned so far."""
        self._wants = wants
        self._walk: LogWalk | None = None
        self._records: Iterator[LogRecord] = iter(())
        self._next: LogRecord | None = None

    def peek(self) -> LogRecord | None:
        """Returns the next selected record; None at the end."""
        if self._walk is None:
            self._open()
        while self._next is not None and not self._wants(self._next.topic.topic):
            self._read(self.index + 1)
        return self._next

    def advance(self) -> None:
        """Advances past the record that `peek` returns."""
        if self._next is not None:
            self.selected += 1
            self.last_ns = max(self.last_ns, self._next.time_ns)
            self._read(self.index + 1)

    def seek(self, index: int) -> None:
        """Seeks to the record with this number, or to the next selected one after it."""
        if self._walk is None or index < self.index:
            self._open()
        while self.index < index and self.peek() is not None and self.index < index:
            self.advance()

    def close(self) -> None:
        """Closes the file; `peek` would restart."""
        self._walk = None
        self._next = None
        self._records = iter(())

    def _open(self) -> None:
        self.close()
        self._walk = LogWalk(self.path)
        self._records = iter(self._walk)
        self.selected = self.last_ns = 0
        self._read(0)
        self.first_ns = self._next.time_ns if self._next is not None else 0

    def _read(self, index: int) -> None:
        self.index = index
        try:
            self._next = next(self._records, None)
        except (OSError, RecordingError) as error:  # the file was removed meanwhile
            self._next = None
            self.problem = f"can no longer be read: {error}"
            return
        if self._next is None and self._walk is not None:
            self.problem = self._walk.problem
