"""Checks before a flight that its output files can be written."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from volery.core.errors import RecordingError, VoleryError, reason_of


def check_record(path: Path, *, overwrite: bool) -> None:
    """Raises `RecordingError` or `VoleryError` if a log cannot be created."""
    from volery.bridges.logs.log_writer import check_target

    check_target(path, overwrite=True)
    if os.path.lexists(path) and not overwrite:
        raise RecordingError(f"{path}: exists already; choose another name or give --overwrite")
    _check_parent(path, "the log")


def check_report(folder: Path, *, overwrite: bool) -> None:
    """Raises `VoleryError` if no report can be written into a folder, or it holds one already."""
    from volery.report.page import check_target

    _check_parent(folder, "the report")
    check_folder(folder, "the report")
    check_target(folder, overwrite=overwrite)


def check_folder(folder: Path, what: str) -> None:
    """Raises `VoleryError` if `what` cannot be written into a folder.

    The same holds if the folder is missing and cannot be created.
    """
    if folder.exists() and not folder.is_dir():
        raise VoleryError(f"{folder} is not a folder")
    existing = folder.absolute()
    while not existing.exists():
        existing = existing.parent
    try:
        with tempfile.TemporaryDirectory(prefix=".volery-", dir=existing):
            return
    except OSError as error:
        raise VoleryError(f"{folder}: cannot write {what} there: {reason_of(error)}") from None


def _check_parent(path: Path, what: str) -> None:
    """Raises `VoleryError` if a path's parent is missing, unless only the last folder is missing.

    A folder is never created directly below the root, where a mistyped first folder would end up.
    """
    parent = path.absolute().parent
    above = parent.parent
    if parent.is_dir():
        return
    problem = f"folder {parent} does not exist"
    if parent.exists():
        problem = f"{parent} is not a folder"
    elif above.is_dir() and above != above.parent:
        return
    hint = "" if parent.exists() else f"; create it with `mkdir -p {parent}`"
    raise VoleryError(f"{path}: cannot create {what}: {problem}{hint}")
