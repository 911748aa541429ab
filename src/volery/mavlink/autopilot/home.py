"""The home position: the reference of heights and the goal of returns."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot

_FARTHEST_M, _HIGHEST_M = 1e6, 1e5
"""Limits from the map's origin, beyond which a flat map is invalid (modelling choice; PX4 has
none)."""


def set_here(autopilot: Autopilot) -> None:
    """Sets home to the UAV's position."""
    autopilot.memory.home, autopilot.memory.chosen_home = autopilot.state.position, None
    _tell(autopilot)


def set_on_arming(autopilot: Autopilot) -> None:
    """Sets home to the position of arming; a home chosen by a client stays, as in PX4."""
    if autopilot.memory.chosen_home is None:
        set_here(autopilot)


def choose(autopilot: Autopilot, latitude: float, longitude: float, z: float) -> str:
    """Sets home to a position in degrees and a height in the map, m.

    Returns why not, empty if home is set.
    """
    origin = autopilot.build.origin
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        return "Home is not on the earth"
    place = autopilot.earth.place(latitude, longitude, origin[2])
    if not (math.hypot(*place) <= _FARTHEST_M and abs(z) <= _HIGHEST_M):
        return "Home is too far away"
    autopilot.memory.home = (place[0], place[1], z)
    autopilot.memory.chosen_home = (latitude, longitude, z + origin[2])
    _tell(autopilot)
    return ""


def _tell(autopilot: Autopilot) -> None:
    from volery.mavlink.autopilot.telemetry import BUILDERS, HOME_POSITION

    autopilot.send(BUILDERS[HOME_POSITION](autopilot))
