"""Where the targets of file formats put the files that they feed."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path


@cache
def _folder():
    """A folder for the process, in memory where there is such a one."""
    memory = Path("/dev/shm")
    parent = memory if memory.is_dir() else None
    return tempfile.TemporaryDirectory(prefix="volery-fuzz-", dir=parent)


def path_of(name):
    """Path of a file in the process's own folder."""
    return Path(_folder().name, name)
