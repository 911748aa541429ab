"""Submissions: a Python file or a folder for each student."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from volery.core.errors import ScenarioError, VoleryError

MODULE = "submission"
"""Name of a submission's module while it flies."""
MAX_BYTES = 20_000_000
MAX_FILES = 1000


class SubmissionError(VoleryError):
    """A submission cannot be flown."""


@dataclass(frozen=True)
class Submission:
    """What one student hands in."""

    name: str
    """Name of the file or folder, without an ending."""
    path: Path
    """A Python file, or a folder with `submission.py`."""

    def copy_to(self, folder: Path) -> None:
        """Copies it into a folder, as `submission.py` and, of a folder, the files beside it.

        Raises `SubmissionError` for links, which could lead to other files, and for more than
        `MAX_BYTES` or `MAX_FILES`.
        """
        is_folder = self.path.is_dir() and not self.path.is_symlink()
        files = sorted(self.path.rglob("*")) if is_folder else [self.path]
        if len(files) > MAX_FILES:
            raise SubmissionError(f"it has more than {MAX_FILES} files")
        if any(file.is_symlink() for file in files):
            raise SubmissionError("it contains a symbolic link")
        plain = [file for file in files if file.is_file()]
        if sum(file.stat().st_size for file in plain) > MAX_BYTES:
            raise SubmissionError(f"it is larger than {MAX_BYTES / 1e6:g} MB")
        for file in plain:
            inside = file.relative_to(self.path) if is_folder else Path(f"{MODULE}.py")
            target = folder / inside
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, target)
        if not (folder / f"{MODULE}.py").is_file():
            raise SubmissionError(f"it has no {MODULE}.py")


def find_submissions(path: Path) -> list[Submission]:
    """Returns the submission in a Python file, or all in a folder, by name.

    In a folder these are its Python files and its folders; names that begin with `.` or `_` are
    none. Raises `ScenarioError` without any.
    """
    if path.is_file():
        if path.suffix != ".py":
            raise ScenarioError(f"{path}: a submission is a .py file, or a folder with {MODULE}.py")
        return [Submission(path.stem, path)]
    if not path.is_dir():
        raise ScenarioError(f"{path}: no such file or folder")
    if (path / f"{MODULE}.py").is_file():
        return [Submission(path.resolve().name, path)]
    found = [
        Submission(each.stem if each.suffix == ".py" else each.name, each)
        for each in sorted(path.iterdir())
        if not each.name.startswith((".", "_")) and (each.suffix == ".py" or each.is_dir())
    ]
    if not found:
        raise ScenarioError(f"{path}: no submissions: .py files, or folders with {MODULE}.py")
    names = [submission.name for submission in found]
    for name in names:
        if names.count(name) > 1:
            raise ScenarioError(f"{path}: two submissions are called '{name}'")
    return found
