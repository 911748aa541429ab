"""What a leader hands to a worker before a divided run, as plain data.

The files that the scenario names travel. A worker reads no others of its own, and starts nodes that
ship with Volery or are installed there, unless it trusts its leader. A worker that was started with
the folder of the scenario reads the files there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from volery.core.errors import DivisionError
from volery.runtime.construction.partition import Partition
from volery.scenario.access import ScenarioAccess
from volery.scenario.file_names import texts_of
from volery.scenario.load import parse_scenario
from volery.scenario.schema import Scenario

_MAX_BYTES = 500_000_000
"""Limit of the files that a scenario names."""


@dataclass(frozen=True)
class DivisionJob:
    """A worker's part of a divided run."""

    content: dict[str, Any]
    """The scenario, as plain data."""
    files: dict[str, bytes]
    """Contents of the scenario's files by their names; none for a worker that has its folder."""
    uavs: tuple[str, ...]
    """UAVs that the worker serves."""
    repeated: int = 0
    """Frames of the leader, but the early ones, that a lost worker was sent."""

    def scenario(self, target: Path, *, trust: bool, folder: Path | None = None) -> Scenario:
        """Returns the scenario; its files are written into the empty folder `target`.

        folder: that of the scenario, if this machine has it; then all files may be read. Raises
        `ScenarioError`, `DivisionError`.
        """
        for name, content in self.files.items():
            if not _is_inner(name):
                raise DivisionError(f"the leader's file '{name[:80]}' lies outside of its folder")
            path = target / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        access = ScenarioAccess(
            target if folder is None else folder,
            is_confined=not trust and folder is None,
            is_trusted=trust,
            own_nodes=frozenset(_nodes(self.content)),
        )
        where = f"the leader's scenario '{str(self.content.get('name'))[:80]}'"
        return parse_scenario(self.content, where=where, access=access)

    @property
    def partition(self) -> Partition:
        """UAVs that the worker serves."""
        return Partition(is_leader=False, named=frozenset(self.uavs))


def files_of(scenario: Scenario) -> dict[str, bytes]:
    """Returns the contents of the files that a scenario names, by their names.

    Raises `DivisionError` for files that cannot travel.
    """
    folder = Path() if scenario.access.folder is None else scenario.access.folder
    found: dict[str, bytes] = {}
    size = 0
    for name in texts_of(scenario.model_dump(exclude_unset=True)):
        path = folder / name
        if name in found or not _is_file(path):
            continue
        if not _is_inner(name):
            raise DivisionError(
                f"{scenario.name}: '{name}' lies outside of the scenario's folder: only files "
                "below it travel to other machines"
            )
        size += path.stat().st_size
        if size > _MAX_BYTES:
            raise DivisionError(
                f"{scenario.name}: its files have more than {_MAX_BYTES / 1e6:.0f} MB, too much "
                "for other machines"
            )
        found[name] = path.read_bytes()
    return found


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # too long, or no path at all
        return False


def _is_inner(name: str) -> bool:
    path = PurePosixPath(name)
    return bool(name) and not (path.is_absolute() or ".." in path.parts)


def _nodes(content: dict[str, Any]) -> Iterator[str]:
    """Yields the nodes that a scenario names."""
    for kind in content.get("types", {}).values():
        yield from (entry["node"] for entry in kind.get("nodes", ()))
    yield from (entry["node"] for entry in content.get("nodes", ()))
