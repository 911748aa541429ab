"""Access of a scenario to files and code.

The value travels with the scenario to all code that opens a file for it or imports a node. A
scenario that its user names may read all files that the user may read. A confined one, from a log
or an upload, reads only below its own folder and among the shipped data, and starts only shipped
nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from volery.core.errors import DataFileError

SHIPPED_DATA = Path(__file__).resolve().parent.parent / "world" / "data"
"""Folder of the shipped data files."""


@dataclass(frozen=True)
class ScenarioAccess:
    """Folders that a scenario may read, and nodes that it may start.

    The default is for scenarios made by a program, which the program trusts.
    """

    folder: Path | None = None
    """Base folder of relative names; None: the working folder."""
    code_folder: Path | None = None
    """Folder of local modules; None: `folder`."""
    is_confined: bool = False
    """Whether only files below `folder` and shipped data are read, and only shipped nodes start."""
    is_trusted: bool = True
    """Whether modules in `folder` and in the working folder may be imported as nodes."""
    own_names: frozenset[str] = frozenset()
    """File names that a confined scenario has in common with a user's own file: not confined."""
    own_nodes: frozenset[str] = frozenset()
    """Nodes, as files name them, that a confined scenario has in common with a user's own file."""

    @property
    def module_folders(self) -> tuple[Path, ...]:
        """Folders of local modules: the scenario's and the working folder."""
        folder = self.folder if self.code_folder is None else self.code_folder
        return (Path(),) if folder is None else (folder, Path())

    def with_code_in(self, name: str | None) -> ScenarioAccess:
        """Returns the access with local modules in a folder, relative to the scenario's.

        None: in the scenario's folder; always so for a confined scenario.
        """
        if name is None or self.is_confined:
            return self if self.code_folder is None else replace(self, code_folder=None)
        return replace(self, code_folder=(self.folder or Path()) / name)

    def find_file(self, name: str, shipped: Path | None = SHIPPED_DATA) -> Path:
        """Returns the path of a file: in the scenario's folder, the working folder or shipped data.

        Raises `DataFileError` if there is none that may be read.
        """
        return self._find(name, shipped, Path.is_file, "file")

    def find_folder(self, name: str) -> Path:
        """Returns the path of a folder: in the scenario's folder or the working folder.

        Raises `DataFileError` if there is none, or the scenario is confined: a log or an upload may
        name single files only.
        """
        if not self._is_free(name):
            raise DataFileError(
                f"no folder '{name[:80]}' that may be read: a scenario of a log or an upload "
                "reads no folders"
            )
        return self._find(name, None, Path.is_dir, "folder")

    def find_model(self, name: str) -> str:
        """Returns the path of a model's `.toml` file, as `find_file`; other names unchanged."""
        return str(self._find(name, None, Path.is_file, "file")) if name.endswith(".toml") else name

    def allows_work_folder(self, name: str) -> bool:
        """Returns whether a node may write to a folder; confined, below the working folder only."""
        return self._is_free(name) or (_is_inner(name) and _is_below(Path(name), Path()))

    def _is_free(self, name: str) -> bool:
        return not self.is_confined or name in self.own_names

    def _find(
        self, name: str, shipped: Path | None, exists: Callable[[Path], bool], what: str
    ) -> Path:
        if "\0" in name:
            raise DataFileError(f"the name of a {what} that may be read must not contain NUL")
        folders = [] if self.folder is None else [self.folder]
        folders += [Path()] if self._is_free(name) else []
        folders += [] if shipped is None else [shipped]
        for folder in folders:
            path = folder / name
            is_open = self._is_free(name) or (
                _is_inner(name) and (folder is shipped or _is_below(path, folder))
            )
            if is_open and _exists(path, exists):
                return path
        if not self._is_free(name):
            raise DataFileError(
                f"no {what} '{name[:80]}' that may be read: a scenario of a log or an upload "
                "reads only below its own folder and among shipped data"
            )
        looked = (
            [Path(name).parent]
            if Path(name).is_absolute()
            else [(folder / name).parent.resolve() for folder in folders]
        )
        shown = ", ".join(dict.fromkeys(str(folder) for folder in looked))
        advice = "; write / between folders" if "\\" in name else ""
        raise DataFileError(f"no {what} '{name}' (looked in {shown}){advice}")


def _is_inner(name: str) -> bool:
    """Returns whether a name is relative and never goes up."""
    path = Path(name)
    return not (path.is_absolute() or ".." in path.parts)


def _is_below(path: Path, folder: Path) -> bool:
    """Returns whether a path is below a folder when links are resolved."""
    try:
        return path.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):
        return False


def _exists(path: Path, exists: Callable[[Path], bool]) -> bool:
    try:
        return exists(path)
    except (OSError, ValueError):  # too long, or no path at all
        return False
