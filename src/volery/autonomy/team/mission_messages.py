"""Builds the messages of search areas and goals."""

from __future__ import annotations

from volery.autonomy.search.search_positions import Area
from volery.core.arrays import Array
from volery.graph.messages import (
    Point,
    Point32,
    Polygon,
    PolygonStamped,
    Pose,
    PoseStamped,
    Quaternion,
    header,
    single,
)


def polygon_of(area: Area | None, z: float, time_ns: int) -> PolygonStamped:
    """Returns the corners of an area, counter-clockwise at height `z`; none without an area."""
    corners = [] if area is None else [area[:2], (area[2], area[1]), area[2:], (area[0], area[3])]
    points = [Point32(single(x), single(y), single(z)) for x, y in corners]
    return PolygonStamped(header(time_ns, "map"), Polygon(points))


def goal_at(position: Array, time_ns: int) -> PoseStamped:
    """Returns a goal at `position` (3,) m with any heading."""
    level = Quaternion(0.0, 0.0, 0.0, 1.0)
    return PoseStamped(header(time_ns, "map"), Pose(Point(*position.tolist()), level))
