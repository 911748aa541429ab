"""Finds the git commit of the source. `tools/record_commit.py` runs this file during builds."""

from __future__ import annotations

import json
import subprocess
from dataclasses import asdict, dataclass
from pathlib import Path

_GIT_TIMEOUT_S = 5.0


@dataclass(frozen=True)
class Commit:
    """Names a git commit.

    `id` is the full hash; `is_changed`: whether tracked files differ from the commit.
    """

    id: str
    is_changed: bool

    def __str__(self) -> str:
        return f"commit {self.id[:12]}{', changed' if self.is_changed else ''}"

    def to_json(self) -> str:
        """Returns the fields as one JSON object."""
        return json.dumps(asdict(self))


def find_commit(checkout: Path, recorded: Path) -> Commit | None:
    """Returns the commit of a checkout, else the one that a build recorded, else None."""
    if (checkout / ".git").exists() and (commit := read_commit(checkout)):
        return commit
    try:
        data = json.loads(recorded.read_text(encoding="utf-8"))
        return Commit(str(data["id"]), bool(data["is_changed"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def read_commit(checkout: Path) -> Commit | None:
    """Returns the commit of a git checkout; None without git or without a commit."""
    head = _git(checkout, "rev-parse", "HEAD")
    changes = _git(checkout, "status", "--porcelain", "--untracked-files=no")
    return Commit(head, is_changed=bool(changes)) if head and changes is not None else None


def _git(checkout: Path, *args: str) -> str | None:
    command = ["git", "--no-optional-locks", "-C", str(checkout), *args]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_GIT_TIMEOUT_S, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
