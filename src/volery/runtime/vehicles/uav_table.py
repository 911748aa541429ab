"""The UAVs of a simulation by name."""

from __future__ import annotations

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
