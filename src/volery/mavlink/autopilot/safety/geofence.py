"""Checks the geofence: distance and height limits from home, inclusion and exclusion areas."""

from __future__ import annotations

import math

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.protocols import plans
from volery.mavlink.autopilot.vehicle import Vector


def breach(context: AutopilotContext, position: Vector) -> str:
    """Returns which limit a position in the map violates; empty if it is allowed.

    Being inside one of several inclusion areas is enough, as for PX4's polygons.
    """
    home = context.memory.home_or_origin
    max_distance = float(context.parameter("GF_MAX_HOR_DIST"))
    max_height = float(context.parameter("GF_MAX_VER_DIST"))
    if max_distance > 0.0 and math.dist(position[:2], home[:2]) > max_distance:
        return "maximum distance from home"
    if max_height > 0.0 and position[2] - home[2] > max_height:
        return "maximum altitude above home"
    inside: list[bool] = []
    items = context.memory.plans[plans.FENCE]
    k = 0
    while k < len(items):
        item = items[k]
        corners = 1
        if item.command in (plans.CIRCLE_IN, plans.CIRCLE_OUT):
            held = math.dist(_point(context, item), position[:2]) < item.params[0]
        elif item.command in (plans.POLYGON_IN, plans.POLYGON_OUT):
            corners = int(item.params[0])
            held = _contains([_point(context, one) for one in items[k : k + corners]], position)
        else:
            held = False
        k += corners
        if item.command in (plans.CIRCLE_IN, plans.POLYGON_IN):
            inside.append(held)
        elif held:
            return "an area to stay out of"
    return "" if not inside or any(inside) else "the area to stay in"


def _point(context: AutopilotContext, item: plans.MissionItem) -> tuple[float, float]:
    x, y, _ = context.earth.map_position(item.latitude, item.longitude, context.build.origin[2])
    return x, y


def _contains(corners: list[tuple[float, float]], position: Vector) -> bool:
    """Returns whether a polygon contains a point: a ray to the east crosses an odd number of sides.

    (W. R. Franklin, "PNPOLY - Point Inclusion in Polygon Test".)
    """
    x, y, _ = position
    odd = False
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        if (ay > y) != (by > y) and x < (bx - ax) * (y - ay) / (by - ay) + ax:
            odd = not odd
    return odd
