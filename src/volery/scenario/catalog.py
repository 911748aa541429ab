"""Scenarios and logs by name."""

from __future__ import annotations

import re
from pathlib import Path

from volery.core.errors import RecordingError, ScenarioError
from volery.scenario import library
from volery.scenario.load import load_scenario
from volery.scenario.schema import Scenario

_LOG_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_. -]{0,99}\.(mcap|bag)")
"""Excludes folders and hidden files."""

_MAX_LOADED = 1_000


class ScenarioCatalog:
    """The library and, optionally, a folder with more: `FOLDER/NAME/scenario.toml`.

    Names of the library come first: a scenario of the folder cannot hide a shipped one. `logs` is
    the folder of recorded logs that may be played; None: none. `given` is a scenario from
    elsewhere, such as the command line; it cannot hide others either.
    """

    FILE = "scenario.toml"

    def __init__(
        self,
        folder: Path | None = None,
        logs: Path | None = None,
        given: Scenario | None = None,
    ) -> None:
        self.folder = folder
        self._logs = logs
        self._given = given
        self._loaded: dict[Path, tuple[tuple[int, int, int], Scenario]] = {}

    def names(self) -> tuple[str, ...]:
        """Returns all names that can be loaded."""
        return (*library.names(), *self.added(), *(each.name for each in self.given()))

    def given(self) -> tuple[Scenario, ...]:
        """Returns the given scenario, unless another one has its name."""
        given = self._given
        if given is None or given.name in (*library.names(), *self.added()):
            return ()
        return (given,)

    def added(self) -> tuple[str, ...]:
        """Returns the names of the folder's scenarios, sorted."""
        if self.folder is None or not self.folder.is_dir():
            return ()
        found = (path.parent.name for path in self.folder.glob(f"*/{self.FILE}"))
        shipped = set(library.names())
        return tuple(sorted(n for n in found if n not in shipped and not n.startswith(".")))

    def load(self, name: str) -> Scenario:
        """Returns a scenario by its name; raises `ScenarioError` for a missing or invalid one."""
        if name in library.names():
            return load_scenario(name)
        for given in self.given():
            if given.name == name:
                return given
        if self.folder is None or name not in self.added():
            raise ScenarioError(f"no scenario '{name}'; known: {', '.join(self.names())}")
        return self._load_added(self.folder / name / self.FILE)

    def _load_added(self, path: Path) -> Scenario:
        """Returns a scenario of the folder, read again only if its file has changed."""
        try:
            status = path.stat()
        except OSError:
            return load_scenario(path, confined=True)
        mark = status.st_mtime_ns, status.st_size, status.st_ino
        known = self._loaded.get(path)
        if known is None or known[0] != mark:
            if len(self._loaded) >= _MAX_LOADED:
                self._loaded.clear()
            known = self._loaded[path] = mark, load_scenario(path, confined=True)
        return known[1]

    def log(self, name: str) -> Path:
        """Returns a log by the name of its file; raises `RecordingError` if it does not exist."""
        if self._logs is None:
            raise RecordingError("this process has no folder of recordings")
        path = self._logs / name
        if not _LOG_NAME.fullmatch(name) or path.is_symlink() or not path.is_file():
            raise RecordingError(f"there is no recording '{name[:100]}'")
        return path
