"""Finds the positions of a plan's items in the map."""

from __future__ import annotations

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.protocols import plans
from volery.mavlink.autopilot.vehicle import Vector


def item_position(context: AutopilotContext, item: plans.MissionItem) -> Vector:
    """Returns an item's position in the map, m; above home or sea level according to its frame."""
    x, y, _ = context.state.position
    if item.placed:
        x, y, _ = context.earth.map_position(item.latitude, item.longitude, context.build.origin[2])
    base = context.memory.home_or_origin
    above = item.frame in plans.ABOVE_HOME
    z = item.altitude + (base[2] if above else -context.build.origin[2])
    return x, y, z
