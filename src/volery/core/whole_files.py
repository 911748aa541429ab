"""Writes files whole or not at all, and through no link.

A file is written under a random name in the same folder and then renamed. A full disk or a killed
process leaves the previous file as it was, and a link of the file's name is replaced, not followed.
"""

from __future__ import annotations

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

PARTIAL = ".part"
"""Ending of the names of unfinished files."""
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
_CONTINUED = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW | os.O_CLOEXEC


def write_whole(
    path: str | Path, content: bytes | str, *, overwrite: bool = True, private: bool = False
) -> int:
    """Writes a file (text as UTF-8) and returns its number of bytes. See `whole_file`."""
    data = content.encode() if isinstance(content, str) else content
    with whole_file(path, overwrite=overwrite, private=private) as file:
        file.write(data)
    return len(data)


@contextmanager
def whole_file(
    path: str | Path, *, overwrite: bool = True, durable: bool = False, private: bool = False
) -> Iterator[BinaryIO]:
    """Yields a binary file that appears at `path` when the context ends without an error.

    An existing file keeps its permissions. A link is replaced by a file; devices, pipes and names
    below /dev and /proc are written directly.

    Parameters
    ----------
    path
        The file; its folder must exist.
    overwrite
        Replace an existing file.
    durable
        Wait until the content is on the disk, so that it survives a power failure.
    private
        Allow only this user to read or write the file.

    Raises
    ------
    FileExistsError
        The file exists and `overwrite` is not set.
    OSError
        The file cannot be written; nothing of it remains.

    """
    path = Path(path)
    if _is_stream(path):
        with path.open("wb") as stream:
            yield stream
        return
    if not overwrite and os.path.lexists(path):
        raise FileExistsError(errno.EEXIST, "the file exists", str(path))
    partial = new_partial(path)
    try:
        descriptor = os.open(partial, _NEW, 0o600 if private else 0o666)
        with os.fdopen(descriptor, "wb") as file:
            if not private:
                _keep_permissions(path, descriptor)
            yield file
            file.flush()
            if durable:
                os.fsync(descriptor)
        put_in_place(partial, path, overwrite=overwrite)
    finally:
        with suppress(OSError):
            partial.unlink()


def open_new(path: Path) -> BinaryIO:
    """Opens a new file for output that grows, in place of what has its name.

    Raises `OSError` if it cannot be made.
    """
    path.unlink(missing_ok=True)
    return os.fdopen(os.open(path, _NEW, 0o666), "wb")


def open_to_append(path: Path) -> BinaryIO:
    """Opens a file for output that continues it; a link of its name is replaced by a new file.

    Devices and pipes are written directly. Raises `OSError` if it cannot be opened.
    """
    if _is_stream(path):
        return path.open("ab")
    if path.is_symlink():
        path.unlink()
    return os.fdopen(os.open(path, _CONTINUED, 0o666), "ab")


def new_partial(path: Path, ending: str = PARTIAL) -> Path:
    """Returns a random hidden name in the folder of a file, under which nothing exists."""
    return path.with_name(f".volery-{secrets.token_hex(8)}{ending}")


def put_in_place(partial: Path, path: Path, *, overwrite: bool) -> None:
    """Renames a finished file. Raises `FileExistsError` for an existing one without `overwrite`."""
    if not overwrite:
        try:
            os.link(partial, path, follow_symlinks=False)
        except FileExistsError:
            raise
        except OSError:  # a file system without hard links
            if os.path.lexists(path):
                raise FileExistsError(errno.EEXIST, "the file exists", str(path)) from None
        else:
            partial.unlink()
            return
    os.replace(partial, path)


def _is_stream(path: Path) -> bool:
    """Returns whether a name stands for a device or pipe, which no file may replace."""
    folder = path.parent.absolute().resolve()
    if folder == Path("/dev") or folder.is_relative_to("/proc"):
        return True
    try:
        mode = path.lstat().st_mode
    except OSError:
        return False
    return stat.S_ISCHR(mode) or stat.S_ISFIFO(mode)


def _keep_permissions(path: Path, descriptor: int) -> None:
    with suppress(OSError):
        found = path.lstat()
        if stat.S_ISREG(found.st_mode):
            os.fchmod(descriptor, stat.S_IMODE(found.st_mode) & 0o777)
