"""Finds objects that installed packages register by name, as Python entry points.

A package registers its own in its `pyproject.toml`:

    [project.entry-points."volery.nodes"]
    my_planner = "my_package.planning:Planner"

Names that Volery ships cannot be replaced by other packages.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from importlib.metadata import Distribution, EntryPoint

_OWN = "volery."
_log = logging.getLogger(__name__)


class _Target(NamedTuple):
    value: str
    package: str


class EntryPoints:
    """The names of one group; the first use reads the metadata of installed packages."""

    def __init__(self, group: str) -> None:
        self._group = group

    def names(self) -> list[str]:
        """Returns all names, sorted."""
        return sorted(self._targets)

    def find(self, name: str) -> str | None:
        """Returns the `module:attribute` of a name without importing it; None: no such name."""
        target = self._targets.get(name)
        return None if target is None else target.value

    def package(self, name: str) -> str:
        """Returns the package that registers a name; empty: no such name."""
        target = self._targets.get(name)
        return "" if target is None else target.package

    @cached_property
    def _targets(self) -> dict[str, _Target]:
        from importlib.metadata import distributions

        found: dict[str, _Target] = {}
        for package in distributions():
            for point in _points_of(package, self._group):
                known = found.get(point.name)
                if known is None or (_is_own(point.value) and not _is_own(known.value)):
                    found[point.name] = _Target(point.value, _name_of(package))
        return found


def _points_of(package: Distribution, group: str) -> Iterable[EntryPoint]:
    """Returns a package's entry points of a group; on an error logs the reason, returns none.

    `importlib.metadata.entry_points` would fail for all packages together.
    """
    try:
        return package.entry_points.select(group=group)
    except Exception as error:  # a damaged file may raise anything
        _log.warning("package %s: its entry points cannot be read: %s", _name_of(package), error)
        return ()


def _name_of(package: Distribution) -> str:
    try:
        name = package.metadata["Name"]
    except Exception:  # a damaged file may raise anything
        name = None
    return name or f"without a name in {package.locate_file('')}"


def _is_own(value: str) -> bool:
    return value.startswith(_OWN)
