"""Folders from which Volery reads code or decisions: no other user may write there.

Compiled kernels are unpickled and run, and a saved answer starts modules. A user that can write or
exchange the files behind them runs code as the user that reads them.
"""

from __future__ import annotations

import logging
import os
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_OTHERS = stat.S_IRWXG | stat.S_IRWXO
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_log = logging.getLogger(__name__)


class UnsafeFolderError(OSError):
    """Another user can write a folder or file; the text says which one and why."""


def private_folder(base: Path, *below: str) -> Path:
    """Returns the folder `base/below[0]/...`, made if missing, that only this user can write.

    No other user may be able to write or exchange `base` or a folder above it. The folders of
    `below` are Volery's own and get the mode 0700. The last one is deleted and made anew, with a
    warning, if others could write one of them before, or if it holds links or files of others.

    Raises
    ------
    UnsafeFolderError
        Another user owns or can write one of the folders.
    OSError
        A folder cannot be made or used.

    """
    folder = base.absolute().resolve()  # a link that changes later has no effect
    for directory in (*reversed(folder.parents), folder):
        if not directory.exists():
            directory.mkdir(mode=0o700, exist_ok=True)
    check_above(folder)
    reason = ""
    for name in below:
        folder /= name
        folder.mkdir(mode=0o700, exist_ok=True)
        mode = _mode_of_own(folder)
        if mode & _OTHERS_WRITE:
            reason = f"other users could write {folder}"
        if mode & _OTHERS:
            folder.chmod(0o700)
    reason = reason or _foreign_content(folder)
    if reason:
        _log.warning("%s: its content is deleted", reason)
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(mode=0o700, exist_ok=True)
    return folder


def state_root() -> Path:
    """Returns the folder of saved state: below XDG_STATE_HOME, or ~/.local/state.

    Raises `OSError` for a user without a home folder, whose state is not saved.
    """
    base = os.environ.get("XDG_STATE_HOME")
    try:
        root = Path(base) if base else Path.home() / ".local" / "state"
    except RuntimeError as error:
        raise FileNotFoundError(str(error)) from None
    return root / "volery"


def temporary_folder(prefix: str) -> Path:
    """Returns a folder in the temporary folder that only this user can write.

    prefix: start of its name. The user's number follows, or a random word if that folder exists
    and is not safe.
    """
    folder = Path(tempfile.gettempdir()) / f"{prefix}{os.getuid()}"
    with suppress(OSError):
        folder.mkdir(mode=0o700, exist_ok=True)
        if not _mode_of_own(folder) & _OTHERS_WRITE:
            folder.chmod(0o700)
            return folder
    return Path(tempfile.mkdtemp(prefix=prefix))


def check_above(folder: Path) -> None:
    """Raises `UnsafeFolderError` if another user can write or exchange a resolved folder.

    The folders above it count as well. In a sticky folder such as /tmp no other user exchanges what
    others own. The owner of the root folder is trusted, and so is the group that has the user's
    own number, which has no other members.
    """
    trusted = {os.getuid(), 0, os.stat("/").st_uid}
    for directory in (folder, *folder.parents):
        found = directory.stat()
        if found.st_uid not in trusted:
            raise UnsafeFolderError(f"{directory} belongs to another user")
        if _others_write(found) and not found.st_mode & stat.S_ISVTX:
            raise UnsafeFolderError(f"other users can write {directory}")


def is_safe_to_read(folder: Path) -> bool:
    """Returns whether a folder exists that only root could write, and this process cannot.

    Such a folder is part of a container image or mounted read-only; see `check_above`.
    """
    try:
        check_above(folder.absolute().resolve())
    except OSError:
        return False
    return folder.is_dir() and not os.access(folder, os.W_OK)


def check_own_file(path: Path) -> None:
    """Raises `UnsafeFolderError` if another user can write or exchange an existing file.

    Raises `OSError` if there is none.
    """
    found = path.lstat()
    if not stat.S_ISREG(found.st_mode):
        raise UnsafeFolderError(f"{path} is a link or a special file")
    if found.st_uid != os.getuid():
        raise UnsafeFolderError(f"{path} belongs to another user")
    if _others_write(found):
        raise UnsafeFolderError(f"other users can write {path}")
    check_above(path.parent.absolute().resolve())


def _others_write(found: os.stat_result) -> bool:
    is_shared = bool(found.st_mode & stat.S_IWGRP) and found.st_gid != os.getuid()
    return is_shared or bool(found.st_mode & stat.S_IWOTH)


def _mode_of_own(folder: Path) -> int:
    """Returns the mode of this user's folder.

    Raises `UnsafeFolderError` for a link, a file or another user's folder.
    """
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode):
        raise UnsafeFolderError(f"{folder} is a link or a file")
    if found.st_uid != os.getuid():
        raise UnsafeFolderError(f"{folder} belongs to another user")
    return found.st_mode


def _foreign_content(folder: Path) -> str:
    """Returns what is in a folder or below it that is a link or of another user; empty: nothing."""
    for entry in _entries(folder):
        try:
            found = entry.stat(follow_symlinks=False)
        except FileNotFoundError:
            continue  # another process replaces files
        if not (stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)):
            return f"{entry.path} is a link or a special file"
        if found.st_uid != os.getuid():
            return f"{entry.path} belongs to another user"
    return ""


def _entries(folder: Path | str) -> Iterator[os.DirEntry[str]]:
    with suppress(FileNotFoundError), os.scandir(folder) as entries:
        for entry in entries:
            yield entry
            if entry.is_dir(follow_symlinks=False):
                yield from _entries(entry.path)
