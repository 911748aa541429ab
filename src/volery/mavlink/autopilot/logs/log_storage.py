"""Stores the newest flight logs of one vehicle in a bounded, unnamed temporary file.

The file is a ring: new data overwrites the oldest logs. The file has no name, so that the system
removes it at the end of the process, even after a crash.
"""

from __future__ import annotations

import errno
import os
import tempfile
import weakref
from dataclasses import dataclass

CAPACITY_BYTES = 16 << 20
"""Storage of one vehicle: about half an hour (modelling choice)."""
MAX_LOGS = 20
_BLOCK_BYTES = 1 << 16
"""Bytes held in memory before they are written."""


@dataclass(eq=False)
class StoredLog:
    """One log.

    start: its byte offset since the first log began; time_s: simulated time of its start.
    """

    start: int
    time_s: int
    size: int = 0


class LogStorage:
    """Logs of one vehicle, the oldest first; the last one may still grow."""

    def __init__(self, capacity_bytes: int = CAPACITY_BYTES) -> None:
        self.logs: list[StoredLog] = []
        self._capacity = capacity_bytes
        self._block = bytearray()
        self._written = 0
        """Bytes in the file since the first log began."""
        self._file = -1
        self._finalizer: weakref.finalize[..., LogStorage] | None = None

    @property
    def _end(self) -> int:
        return self._written + len(self._block)

    def begin(self, time_s: int) -> None:
        """Starts a new log. Raises `OSError` if there is no room for a temporary file."""
        if self._file < 0:
            with tempfile.TemporaryFile() as file:
                self._file = os.dup(file.fileno())
            self._finalizer = weakref.finalize(self, os.close, self._file)
        self.logs = [*self.logs[1 - MAX_LOGS :], StoredLog(self._end, time_s)]

    def append(self, data: bytes) -> bool:
        """Appends to the newest log; returns False without a change if the data fills the file.

        Raises `OSError` if the disk is full.
        """
        log = self.logs[-1]
        if log.size + len(data) > self._capacity:
            return False
        log.size += len(data)
        self._block += data
        if len(self._block) >= _BLOCK_BYTES:
            self._flush()
        return True

    def read(self, log: StoredLog, offset: int, num_bytes: int) -> bytes:
        """Returns bytes of a log, fewer at its end, none of a log that is no longer stored.

        Raises `OSError` if the file cannot be read.
        """
        if log not in self.logs or not 0 <= offset < log.size:
            return b""
        start = log.start + offset
        stop = start + min(num_bytes, log.size - offset)
        if stop > self._written:
            self._flush()
        return b"".join(os.pread(self._file, size, at) for at, size in self._pieces(start, stop))

    def erase(self, *, keeps_newest: bool) -> None:
        """Deletes the logs, except for the newest one with `keeps_newest`."""
        self.logs = self.logs[-1:] if keeps_newest else []

    def close(self) -> None:
        """Closes the file; a new log opens another one."""
        if self._finalizer is not None:
            self._finalizer()
        self._file = -1
        self._block.clear()
        self._written = 0
        self.logs = []

    def _flush(self) -> None:
        stop = self._end
        oldest = stop - self._capacity
        self.logs = [log for log in self.logs if log.start >= oldest]
        done = 0
        for at, size in self._pieces(self._written, stop):
            if os.pwrite(self._file, self._block[done : done + size], at) < size:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            done += size
        self._written = stop
        self._block.clear()

    def _pieces(self, start: int, stop: int) -> list[tuple[int, int]]:
        """Returns offsets in the file and sizes of the bytes from `start` to `stop`."""
        pieces = []
        while start < stop:
            at = start % self._capacity
            size = min(stop - start, self._capacity - at)
            pieces.append((at, size))
            start += size
        return pieces
