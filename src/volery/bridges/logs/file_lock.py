"""Advisory locks on logs: one run writes a log at a time, and no other command reads it meanwhile.

A lock is on the file itself and ends with the process that has it. File systems without locks are
supported, without protection.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from volery.core.errors import RecordingError

_BEING_WRITTEN = "is being written by another process; end that first"


def lock_for_writing(descriptor: int, path: Path) -> None:
    """Locks an open file until it is closed. Raises `RecordingError` if another process uses it."""
    _lock(descriptor, path, fcntl.LOCK_EX, "is being written or recovered by another process")


@contextlib.contextmanager
def locked_for_reading(path: Path) -> Iterator[None]:
    """Keeps writers away.

    Raises `RecordingError` if the file is being written or cannot be opened.
    """
    descriptor = _open(path)
    try:
        _lock(descriptor, path, fcntl.LOCK_SH, _BEING_WRITTEN)
        yield
    finally:
        os.close(descriptor)


@contextlib.contextmanager
def locked_for_replacing(path: Path) -> Iterator[None]:
    """Locks a file that is replaced, if it can be opened.

    Raises `RecordingError` if another process uses it.
    """
    try:
        descriptor = _open(path)
    except OSError:
        yield
        return
    try:
        lock_for_writing(descriptor, path)
        yield
    finally:
        os.close(descriptor)


def _open(path: Path) -> int:
    return os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)


def _lock(descriptor: int, path: Path, kind: int, why: str) -> None:
    try:
        fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        raise RecordingError(f"{path}: {why}") from None
    except OSError:
        return  # a file system without locks
