"""Scenarios that can be asked for by name: those that ship, and those of a folder."""

from __future__ import annotations

from pathlib import Path

from volery.core.errors import ScenarioError
from volery.scenario import library
from volery.scenario.load import load_scenario
from volery.scenario.schema import Scenario


class Shelf:
    """The library and, where there is one, a folder with more: `FOLDER/NAME/scenario.toml`.

    Names of the library come first. A shipped scenario cannot be hidden by one of the folder.
    """

    FILE = "scenario.toml"

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder

    def names(self) -> tuple[str, ...]:
        """All names that can be loaded."""
        return (*library.names(), *self.added())

    def added(self) -> tuple[str, ...]:
        """Names of the folder's scenarios, sorted."""
        if self.folder is None or not self.folder.is_dir():
            return ()
        found = (path.parent.name for path in self.folder.glob(f"*/{self.FILE}"))
        shipped = set(library.names())
        return tuple(sorted(n for n in found if n not in shipped and not n.startswith(".")))

    def load(self, name: str) -> Scenario:
        """A scenario by its name. `ScenarioError` where there is none, or it is broken."""
        if name in library.names():
            return load_scenario(name)
        if self.folder is None or name not in self.added():
            raise ScenarioError(f"no scenario '{name}'; known: {', '.join(self.names())}")
        return load_scenario(self.folder / name / self.FILE)
