"""The results of a study on disk: one file for each run, written whole."""

from __future__ import annotations

import errno
import shutil
from collections.abc import Iterable
from pathlib import Path

from volery.cluster.errors import StudyError
from volery.cluster.folder_lock import FolderLock
from volery.cluster.runs import RunResult, RunSpec
from volery.core.errors import reason_of
from volery.core.whole_files import write_whole


class ResultsFolder:
    """Reads and writes the results of runs in a folder, which is created if it does not exist.

    Files are named by the identities of runs, `runs/ab/ab12....json`. A file is written beside its
    place and then renamed, so that a killed process leaves whole files only.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        """The folder."""
        self._made: set[str] = set()
        self.make(path / "logs")
        self.make(path / "runs")

    def clear(self) -> None:
        """Removes all results and logs; for the driver that has locked the folder."""
        self._made.clear()
        for name in ("logs", "runs"):
            shutil.rmtree(self.path / name, ignore_errors=True)
            self.make(self.path / name)

    @property
    def logs(self) -> Path:
        """Folder of logs."""
        return self.path / "logs"

    def make(self, folder: Path) -> None:
        """Creates a folder. Raises `StudyError` if that fails."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StudyError(f"{folder}: cannot be created: {reason_of(error)}") from None

    def locked(self, part: tuple[int, int] | None = None) -> FolderLock:
        """Locks the folder, or a part of its runs. Raises `StudyError` if another driver has it."""
        return FolderLock(self.path, part)

    def file_of(self, identity: str) -> Path:
        """Returns the file of a run's result."""
        return self.path / "runs" / identity[:2] / f"{identity}.json"

    def read(self, identity: str) -> RunResult | None:
        """Returns the result of a run; None if there is none, or its file is damaged."""
        try:
            return RunResult.from_json(self.file_of(identity).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None

    def read_all(self, runs: Iterable[RunSpec]) -> dict[str, RunResult]:
        """Returns the results that exist, by identity."""
        found = ((run.id, self.read(run.id)) for run in runs)
        return {identity: result for identity, result in found if result is not None}

    def write(self, result: RunResult) -> None:
        """Writes a result. Raises `StudyError` if the disk is full or cannot be written to."""
        path = self.file_of(result.id)
        if result.id[:2] not in self._made:
            self.make(path.parent)
            self._made.add(result.id[:2])
        self.write_file(path, result.to_json().encode())

    def write_file(self, path: Path, content: bytes) -> None:
        """Writes a file whole or not at all. Raises `StudyError` if that fails."""
        try:
            write_whole(path, content)
        except OSError as error:
            if error.errno == errno.ENOSPC:
                raise StudyError(disk_full(self.path)) from None
            raise StudyError(f"{path}: cannot be written: {reason_of(error)}") from None


def disk_full(folder: Path) -> str:
    """Returns the sentence about a full disk."""
    return (
        f"{folder}: no space is left on the disk; finished runs are kept: free some space, and "
        "the same command continues"
    )
