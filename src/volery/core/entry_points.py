"""Names that installed packages give to classes and functions, from Python's entry points.

A package adds its own in its `pyproject.toml`:

    [project.entry-points."volery.nodes"]
    my_planner = "my_package.planning:Planner"

A name that Volery gives means what Volery says, whatever else is installed.
"""

from __future__ import annotations

from functools import cached_property

_OWN = "volery."


class EntryPoints:
    """The names of one group; installed packages are read at the first use."""

    def __init__(self, group: str) -> None:
        self._group = group

    def names(self) -> list[str]:
        """Returns all names, sorted."""
        return sorted(self._targets)

    def find(self, name: str) -> str | None:
        """Returns the `module:attribute` that a name stands for, without importing it."""
        return self._targets.get(name)

    @cached_property
    def _targets(self) -> dict[str, str]:
        from importlib.metadata import entry_points

        found: dict[str, str] = {}
        for point in entry_points(group=self._group):
            if point.name not in found or point.value.startswith(_OWN):
                found[point.name] = point.value
        return found
