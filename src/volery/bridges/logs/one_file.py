"""Gives a ROS 2 bag as one MCAP file, which can be read from any of its times."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from volery.bridges.logs.bag_files import BagFiles
from volery.bridges.logs.records import file_signature, log_format
from volery.bridges.logs.recovery import write_mcap
from volery.bridges.logs.ros2_bags import BagWalk
from volery.core.errors import RecordingError


class OneFile(NamedTuple):
    """A log in one file."""

    path: Path
    problem: str
    """What is missing in the file; empty if nothing is, or if the file is the log itself."""


@contextmanager
def one_file(path: Path) -> Iterator[OneFile]:
    """Yields a log in one file: a folder or an SQLite file of a ROS 2 bag is copied for the time.

    The copy lies in a folder for temporary files. Raises `RecordingError` if the bag cannot be read
    or copied, or holds no message.
    """
    if not path.is_dir() and file_signature(path) not in ("sqlite", "zstd"):
        log_format(path, "a ROS 2 bag")
        yield OneFile(path, "")
        return
    with BagFiles(path) as files:
        if len(files.mcap) == 1:
            yield OneFile(files.mcap[0], files.problem)
            return
    with tempfile.TemporaryDirectory(prefix="volery-bag-") as folder:
        copy = Path(folder, f"{path.stem}.mcap")
        walk = BagWalk(path)
        try:
            count, _ = write_mcap(walk, copy)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be copied: {error.strerror}") from None
        if not count:
            raise RecordingError(f"{path}: holds no readable message")
        yield OneFile(copy, walk.problem)
