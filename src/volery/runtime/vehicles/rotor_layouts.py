"""Returns the rotor layouts of a simulation's UAVs, for bridges to autopilots."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from volery.graph.rotor_layout import RotorLayout, RotorPosition

if TYPE_CHECKING:
    from volery.runtime.vehicles.uav import Uav


def rotor_layouts(uavs: Mapping[str, Uav]) -> dict[str, RotorLayout]:
    """Returns the rotors of each UAV by its name; thread-safe."""
    return {name: _layout(uav) for name, uav in dict(uavs).items()}


def _layout(uav: Uav) -> RotorLayout:
    return [
        RotorPosition(rotor.position_m[0], rotor.position_m[1], rotor.direction)
        for rotor in uav.airframe.rotors.places
    ]
