"""Locks a results folder, so that no two drivers write the same results.

The lock is the system's (`flock`) on a file with the holder's process and computer: the system
releases it with the process, so the lock of a dead process is free at once. On a file system
without common locks, the file still names a holder on another computer.
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
import time
from pathlib import Path
from typing import Any

from volery.cluster.errors import StudyError
from volery.core.errors import reason_of

LOCK_FILE = "lock"
_FLAGS = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC


class FolderLock:
    """Holds a results folder, or the part `(i, n)` of its runs, until `release`.

    Different parts of equal division may be held at the same time. Raises `StudyError`, naming the
    holder, if the folder is held.
    """

    def __init__(self, folder: Path, part: tuple[int, int] | None = None) -> None:
        self._folder = folder
        name = LOCK_FILE if part is None else f"{LOCK_FILE}.part-{part[0]}-of-{part[1]}"
        self._path = folder / name
        self._file = self._taken()
        try:
            self._check_others(part)
        except StudyError:
            self.release()
            raise

    def release(self) -> None:
        """Releases the lock and removes its file."""
        if self._file >= 0:
            self._path.unlink(missing_ok=True)
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> FolderLock:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.release()

    def _taken(self) -> int:
        """Returns the locked file."""
        while True:
            try:
                file = os.open(self._path, _FLAGS, 0o644)
            except OSError as error:
                raise StudyError(f"{self._path}: cannot be locked: {reason_of(error)}") from None
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                os.close(file)
                raise StudyError(_held(self._folder, _holder(self._path))) from None
            if _is_same(file, self._path):  # not removed by the holder before us meanwhile
                break
            os.close(file)
        holder = _holder(self._path)
        if holder and holder.get("host") != socket.gethostname():
            os.close(file)
            raise StudyError(
                f"{_held(self._folder, holder)}; if that process has ended, delete {self._path}"
            )
        os.ftruncate(file, 0)
        text = {"pid": os.getpid(), "host": socket.gethostname(), "since": time.strftime("%F %T")}
        os.write(file, json.dumps(text).encode())
        return file

    def _check_others(self, part: tuple[int, int] | None) -> None:
        """Raises `StudyError` if a lock of another division of the runs is held."""
        for path in self._folder.glob(f"{LOCK_FILE}*"):
            own_division = part is not None and path.name.endswith(f"-of-{part[1]}")
            if path != self._path and not own_division and _is_locked(path):
                raise StudyError(_held(self._folder, _holder(path)))


def _is_same(file: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file), path.stat())
    except FileNotFoundError:
        return False


def _is_locked(path: Path) -> bool:
    try:
        file = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    else:
        holder = _holder(path)
        return bool(holder) and holder.get("host") != socket.gethostname()
    finally:
        os.close(file)


def _holder(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _held(folder: Path, holder: dict[str, Any]) -> str:
    owner = ""
    if holder:
        owner = (
            f": process {holder.get('pid')} on {holder.get('host')}, since {holder.get('since')}"
        )
    return (
        f"{folder}: another driver writes results here{owner}; wait for it, or name another --out"
    )
