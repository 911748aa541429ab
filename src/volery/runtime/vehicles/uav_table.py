"""The UAVs of a simulation by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from volery.core.errors import CommandError
from volery.runtime.vehicles.uav import Uav


class UnknownUavError(CommandError, KeyError):
    """The simulation has no UAV of this name."""

    __str__ = Exception.__str__


class UavTable(dict[str, Uav]):
    """UAVs by name, in the order of the fleet.

    Raises `UnknownUavError`, a `KeyError`, for a name without a UAV.
    """

    def __missing__(self, name: str) -> Uav:
        known = ", ".join(self) or "none"
        raise UnknownUavError(f"there is no UAV '{name}'; known: {known}")


class UavView(Mapping[str, Uav]):
    """What a `UavTable` holds at present, for reading."""

    def __init__(self, table: UavTable) -> None:
        self._table = table

    def __getitem__(self, name: str) -> Uav:
        """Returns a UAV by its name. Raises `UnknownUavError`, a `KeyError`."""
        return self._table[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._table)

    def __len__(self) -> int:
        return len(self._table)

    def _ipython_key_completions_(self) -> list[str]:
        """Returns the names that Tab offers after `simulation.uavs["`."""
        return list(self)

    def __repr__(self) -> str:
        return repr(dict(self))
