"""What a scenario may reach: where the files lie that it names, and which code it may start.

The value travels with the scenario to everything that opens a file for it or imports a node. A
scenario that its user names may read all that the user may. A confined one, which comes from a log
or from an upload, reads only below its own folder and among the shipped data, and starts only
shipped nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from volery.core.errors import DataFileError

SHIPPED_DATA = Path(__file__).resolve().parent.parent / "world" / "data"
"""Where the data files lie that come with Volery."""


@dataclass(frozen=True)
class ScenarioAccess:
    """Where a scenario's files may lie and which code it may start.

    The default is that of a scenario that a program makes itself: the program trusts itself.
    """

    folder: Path | None = None
    """Folder that relative names start from; None: the working folder."""
    is_confined: bool = False
    """Whether files are read below `folder` and among shipped data alone, and only shipped nodes
    start."""
    is_trusted: bool = True
    """Whether modules in `folder` and in the working folder may be imported as nodes."""
    own_names: frozenset[str] = frozenset()
    """File names that a confined scenario shares with a file of the user's own: not confined."""
    own_nodes: frozenset[str] = frozenset()
    """Nodes, as files name them, that a confined scenario shares with a file of the user's own."""

    def find_file(self, name: str, shipped: Path | None = SHIPPED_DATA) -> Path:
        """Path of a file: beside the scenario, from the working folder, else among shipped data.

        Raises `DataFileError` where there is none that may be read.
        """
        return self._find(name, shipped, Path.is_file, "file")

    def find_folder(self, name: str) -> Path:
        """Path of a folder: beside the scenario, else from the working folder.

        Raises `DataFileError` where there is none, or the scenario is confined: a log or an upload
        names single files only.
        """
        if not self._is_free(name):
            raise DataFileError(
                f"no folder '{name[:80]}' that may be read: a scenario of a log or of an upload "
                "reads no folders"
            )
        return self._find(name, None, Path.is_dir, "folder")

    def find_model(self, name: str) -> str:
        """Path of a model's `.toml` file, as `find_file`; the name of a shipped model as it is."""
        return str(self._find(name, None, Path.is_file, "file")) if name.endswith(".toml") else name

    def allows_work_folder(self, name: str) -> bool:
        """Whether a node may write into a folder: a confined one only below the working folder."""
        return self._is_free(name) or (_is_inner(name) and _is_below(Path(name), Path()))

    def _is_free(self, name: str) -> bool:
        return not self.is_confined or name in self.own_names

    def _find(
        self, name: str, shipped: Path | None, exists: Callable[[Path], bool], what: str
    ) -> Path:
        if "\0" in name:
            raise DataFileError(f"a {what} that may be read has no NUL in its name")
        folders = [] if self.folder is None else [self.folder]
        folders += [Path()] if self._is_free(name) else []
        folders += [] if shipped is None else [shipped]
        for folder in folders:
            place = folder / name
            is_open = self._is_free(name) or (
                _is_inner(name) and (folder is shipped or _is_below(place, folder))
            )
            if is_open and _exists(place, exists):
                return place
        if not self._is_free(name):
            raise DataFileError(
                f"no {what} '{name[:80]}' that may be read: a scenario of a log or of an upload "
                "reads below its own folder and among shipped data only"
            )
        looked = (
            [Path(name).parent]
            if Path(name).is_absolute()
            else [(folder / name).parent.resolve() for folder in folders]
        )
        shown = ", ".join(dict.fromkeys(str(folder) for folder in looked))
        raise DataFileError(f"no {what} '{name}' (looked in {shown})")


def _is_inner(name: str) -> bool:
    """Whether a name is relative and never goes up."""
    path = Path(name)
    return not (path.is_absolute() or ".." in path.parts)


def _is_below(place: Path, folder: Path) -> bool:
    """Whether a path stays below a folder when links are followed."""
    try:
        return place.resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):
        return False


def _exists(place: Path, exists: Callable[[Path], bool]) -> bool:
    try:
        return exists(place)
    except (OSError, ValueError):  # too long, or no path at all
        return False
