"""Gives a ROS 2 bag as one MCAP file, which can be read from any of its times."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from volery.bridges.logs.recovery import write_mcap
from volery.bridges.logs.ros2_bags import BagWalk, mcap_parts, sqlite_index
from volery.core.errors import RecordingError

_SQLITE = b"SQLite format 3\0"


class OneFile(NamedTuple):
    """A log in one file."""

    path: Path
    problem: str
    """What is missing in the file; empty if nothing is, or if the file is the log itself."""


@contextmanager
def one_file(path: Path) -> Iterator[OneFile]:
    """Yields a log in one file: a folder or an SQLite file of a ROS 2 bag is copied for the time.

    The copy lies in a folder for temporary files, and has the size of the bag or less. Raises
    `RecordingError` if the bag cannot be read or copied, or holds no message.
    """
    parts = mcap_parts(path)
    if len(parts) == 1:
        yield OneFile(parts[0], "")
        return
    if not path.is_dir() and not _is_sqlite(path):
        yield OneFile(path, "")
        return
    problem = "" if parts else sqlite_index(path).problem  # refuses what must not be read
    with tempfile.TemporaryDirectory(prefix="volery-bag-") as folder:
        copy = Path(folder, f"{path.stem}.mcap")
        walk = BagWalk(path)
        try:
            count, _ = write_mcap(walk, copy)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be copied: {error.strerror}") from None
        if not count:
            raise RecordingError(f"{path}: holds no readable message")
        yield OneFile(copy, "; ".join(filter(None, (problem, walk.problem))))


def _is_sqlite(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(_SQLITE)) == _SQLITE
    except OSError:
        return False  # the reader reports the reason
