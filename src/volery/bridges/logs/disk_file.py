"""A file that grows by whole pieces: either a piece is on the disk, or nothing of it is.

Log writers put a chunk together with many small writes. They are gathered in memory and committed
at once; where the disk is full the file is cut back to the last whole piece, so that what remains
is readable.
"""

from __future__ import annotations

import os
from pathlib import Path

from volery.bridges.logs.file_lock import lock_for_writing
from volery.core.errors import RecordingError


class DiskFile:
    """Binary output file with `commit`; offers the few stream methods that log writers call.

    It is locked until it is closed: `RecordingError` where another process has the lock.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        flags = os.O_WRONLY | os.O_CLOEXEC | os.O_CREAT | os.O_EXCL
        self._descriptor = os.open(path, flags, 0o644)
        try:
            lock_for_writing(self._descriptor, path)
        except RecordingError:
            os.close(self._descriptor)
            raise
        self._buffer = bytearray()
        self._committed = 0
        self._rewrites_start = False

    @property
    def pending(self) -> int:
        """Bytes written and not yet committed."""
        return len(self._buffer)

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Gather `data`."""
        self._buffer += data
        return len(data)

    def tell(self) -> int:
        """Position of the next byte."""
        return self._committed + len(self._buffer)

    def seek(self, position: int) -> int:
        """Go back to rewrite the file's start; only once, as the last thing before closing."""
        self.commit()
        self._committed = position
        self._rewrites_start = True
        return position

    def flush(self) -> None:
        """Do nothing: `commit` decides what reaches the disk."""

    def commit(self) -> None:
        """Hand everything gathered to the disk.

        Raises
        ------
        RecordingError
            The disk does not take it; the file then ends with the last whole piece.

        """
        if not self._buffer:
            return
        piece, self._buffer = memoryview(self._buffer), bytearray()
        done = 0
        try:
            while done < len(piece):
                done += os.pwrite(self._descriptor, piece[done:], self._committed + done)
        except OSError as error:
            if not self._rewrites_start:
                os.ftruncate(self._descriptor, self._committed)
            raise RecordingError(
                f"{self.path}: cannot write the log: {error.strerror}; its first "
                f"{self._committed / 1e6:.1f} MB are kept"
            ) from None
        self._committed += done

    def close(self) -> None:
        """Commit and close."""
        try:
            self.commit()
        finally:
            self.discard()

    def discard(self) -> None:
        """Close without what was not committed."""
        self._buffer.clear()
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
