"""The home position: the reference of heights and the goal of returns."""

from __future__ import annotations

import math
from typing import Any

from volery.core.frames import ned_of_enu
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.messages import motion
from volery.mavlink.codec import dialect

_MAX_DISTANCE_M, _MAX_HEIGHT_M = 1e6, 1e5
"""Limits from the map's origin, beyond which a flat map is invalid (modelling choice; PX4 has
none)."""


def set_here(context: AutopilotContext) -> None:
    """Sets home to the UAV's position."""
    context.memory.home, context.memory.chosen_home = context.state.position, None
    context.memory.home_yaw = math.nan
    context.links.send(position_message(context))


def set_on_arming(context: AutopilotContext) -> None:
    """Sets home to the position of arming; a home chosen by a client stays, as in PX4."""
    if context.memory.chosen_home is None:
        set_here(context)


def choose(
    context: AutopilotContext, latitude: float, longitude: float, z: float, yaw: float = math.nan
) -> str:
    """Sets home to a position in degrees, a height in the map, m, and a yaw, rad, map; nan: free.

    Returns why not, empty if home is set.
    """
    origin = context.build.origin
    if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
        return "Home is not on the earth"
    position = context.earth.map_position(latitude, longitude, origin[2])
    if not (math.hypot(*position) <= _MAX_DISTANCE_M and abs(z) <= _MAX_HEIGHT_M):
        return "Home is too far away"
    context.memory.home = (position[0], position[1], z)
    context.memory.chosen_home = (latitude, longitude, z + origin[2])
    context.memory.home_yaw = yaw
    context.links.send(position_message(context))
    return ""


def position_message(context: AutopilotContext) -> Any:
    """Returns HOME_POSITION; None without a home."""
    home = context.memory.home
    if home is None:
        return None
    origin = context.memory.origin
    offset = (home[0] - origin[0], home[1] - origin[1], home[2] - origin[2])
    return dialect().MAVLink_home_position_message(
        *motion.degrees_e7(context.memory.chosen_home or context.earth.geodetic(home)),
        *ned_of_enu(offset),
        _heading(context.memory.home_yaw),
        *(math.nan,) * 3,
        motion.us(context),
    )


def _heading(yaw: float) -> tuple[float, float, float, float]:
    """Returns the quaternion w x y z, NED, of a yaw in the map; nan for nan."""
    if not math.isfinite(yaw):
        return (math.nan,) * 4
    half = 0.5 * (0.5 * math.pi - yaw)
    return math.cos(half), 0.0, 0.0, math.sin(half)
