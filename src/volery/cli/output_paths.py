"""What a flight is to write: refused before the flight where it cannot be, not after it."""

from __future__ import annotations

import tempfile
from pathlib import Path

from volery.core.errors import RecordingError, VoleryError, reason_of


def check_record(path: Path, *, overwrite: bool) -> None:
    """Refuse a log that could not be begun."""
    from volery.bridges.logs.log_writer import check_target

    check_target(path, overwrite=True)
    if path.exists() and not overwrite:
        raise RecordingError(f"{path}: exists already; choose another name or give --overwrite")
    _check_parent(path, "the log")


def check_report(folder: Path) -> None:
    """Refuse a folder in which no report could be written."""
    from volery.report.page import check_folder

    _check_parent(folder, "the report")
    check_folder(folder)


def check_folder(folder: Path, what: str) -> None:
    """Refuse a folder in which `what` could not be written, or made where it would be."""
    if folder.exists() and not folder.is_dir():
        raise VoleryError(f"{folder} is no folder")
    place = folder.absolute()
    while not place.exists():
        place = place.parent
    try:
        with tempfile.TemporaryDirectory(prefix=".volery-", dir=place):
            return
    except OSError as error:
        raise VoleryError(f"{folder}: cannot write {what} there: {reason_of(error)}") from None


def _check_parent(path: Path, what: str) -> None:
    """Refuse a path in a missing folder, unless that alone is missing: more is a slip of the pen.

    Nothing is made directly below the root, where a mistyped first folder would land.
    """
    parent = path.absolute().parent
    above = parent.parent
    if parent.is_dir():
        return
    problem = f"there is no folder {parent}"
    if parent.exists():
        problem = f"{parent} is no folder"
    elif above.is_dir() and above != above.parent:
        return
    hint = "" if parent.exists() else f"; `mkdir -p {parent}` makes it"
    raise VoleryError(f"{path}: cannot create {what}: {problem}{hint}")
