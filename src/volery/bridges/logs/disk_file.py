"""A file that grows by whole pieces: a piece is on the disk completely or not at all.

Log writers assemble a chunk from many small writes. They are buffered in memory and committed at
once. If the disk is full, the file is truncated to the last whole piece, so that the rest stays
readable.
"""

from __future__ import annotations

import os
from pathlib import Path

from volery.bridges.logs.file_lock import lock_for_writing
from volery.core.errors import RecordingError


class DiskFile:
    """Binary output file with `commit`; implements the few stream methods that log writers call.

    The file is locked until it is closed. Raises `RecordingError` if another process has the lock.
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
        """Number of bytes written and not yet committed."""
        return len(self._buffer)

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Buffers `data`."""
        self._buffer += data
        return len(data)

    def tell(self) -> int:
        """Returns the position of the next byte."""
        return self._committed + len(self._buffer)

    def seek(self, position: int) -> int:
        """Goes back to rewrite the file's start; only once, as the last step before closing."""
        self.commit()
        self._committed = position
        self._rewrites_start = True
        return position

    def flush(self) -> None:
        """Does nothing: `commit` writes to the disk."""

    def commit(self) -> None:
        """Writes all buffered bytes to the disk.

        Raises
        ------
        RecordingError
            Writing failed; the file then ends with the last whole piece.

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
                f"{self.path}: cannot write the log: {error.strerror}; the first "
                f"{self._committed / 1e6:.1f} MB are saved"
            ) from None
        self._committed += done

    def close(self) -> None:
        """Commits and closes."""
        try:
            self.commit()
        finally:
            self.discard()

    def discard(self) -> None:
        """Closes without uncommitted bytes."""
        self._buffer.clear()
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
