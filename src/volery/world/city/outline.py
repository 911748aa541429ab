"""A mapped building."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from volery.world.city.heights import Height


@dataclass(frozen=True, eq=False)
class Outline:
    """A mapped building: a shapely MultiPolygon in the map, m, with positive area.

    is_part: whether it is a part of a building, as OpenStreetMap's `building:part`.
    """

    id: str
    footprint: Any
    height: Height
    is_part: bool = False
