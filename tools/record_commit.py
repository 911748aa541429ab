"""Build hook of hatchling: writes the git commit into the wheel and the source distribution.

`volery --version` prints it. A wheel that is built from a source distribution keeps its commit.
"""

from __future__ import annotations

import runpy
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_IN_PACKAGE = {"wheel": "volery/build_commit.json", "sdist": "src/volery/build_commit.json"}


class CommitHook(BuildHookInterface):
    """Adds `build_commit.json` where the source is a git checkout."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Adds the file to a build; editable installations read the checkout itself."""
        self._folder = tempfile.TemporaryDirectory()
        root = Path(self.root)
        if version == "editable" or not (root / ".git").exists():
            return
        commit = runpy.run_path(str(root / "src/volery/cli/commit.py"))["read_commit"](root)
        if commit is not None:
            path = Path(self._folder.name) / "build_commit.json"
            path.write_text(commit.to_json() + "\n", encoding="utf-8")
            build_data["force_include"][str(path)] = _IN_PACKAGE[self.target_name]

    def finalize(self, *_: object) -> None:
        """Removes the temporary file."""
        self._folder.cleanup()
