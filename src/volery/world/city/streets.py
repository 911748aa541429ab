"""Streets between buildings, derived from the buildings alone.

A gap between blocks narrower than `max_width_m` counts as a street: pavement along the walls,
asphalt between the kerbs if it leaves room for a car. Courtyards and alleys are paved. Areas
farther from any wall are not streets: they have the ground's own material.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.world.ground_cover import GroundCover
from volery.world.materials import Material

_ROADWAY_M = 3.0
"""Minimum width of asphalt: a car's (modelling choice)."""
_CELL_M = 0.5
_MAX_CELLS = 16_000_000
"""Maximum number of cells; larger cities get larger cells."""
_ROUGH_M = 0.1
"""Tolerance of kerbs, which saves most of their corners."""
_ROUND = 4
"""Straight segments of a quarter circle around corners."""


@dataclass(frozen=True)
class StreetRule:
    """Geometry of streets; modelling choices."""

    max_width_m: float = 32.0
    pavement_m: float = 3.0


@dataclass(frozen=True, eq=False)
class Streets:
    """Shapely areas in the map, m.

    blocks: buildings with their courtyards. fabric: blocks and the gaps that are streets.
    roadway: asphalt.
    """

    blocks: Any
    fabric: Any
    roadway: Any
    rule: StreetRule


def find_streets(footprints: Sequence[Any], rule: StreetRule) -> Streets:
    """Returns the streets between footprints (shapely polygons, map, m)."""
    import shapely

    walls = shapely.union_all(list(footprints))
    filled = [shapely.Polygon(part.exterior) for part in shapely.get_parts(walls)]
    blocks = shapely.union_all(filled)
    half_width = rule.max_width_m / 2.0
    fabric = blocks.buffer(half_width, quad_segs=_ROUND).buffer(-half_width, quad_segs=_ROUND)
    road = fabric.difference(blocks.buffer(rule.pavement_m, quad_segs=_ROUND))
    half = _ROADWAY_M / 2.0
    road = road.buffer(-half, quad_segs=_ROUND).buffer(half, quad_segs=_ROUND).simplify(_ROUGH_M)
    return Streets(blocks, fabric, road, rule)


def kerb_lines(streets: Streets, from_wall_m: float, roadway_m: float) -> tuple[Array, ...]:
    """Returns lines (n, 2) at a distance from the walls, along roadways at least `roadway_m` wide.

    The blocks lie on their left, the street on their right.
    """
    import shapely

    half = roadway_m / 2.0
    wide = streets.roadway.buffer(-half, quad_segs=1).simplify(0.5)
    along = wide.buffer(half + streets.rule.pavement_m, quad_segs=1)
    around = shapely.orient_polygons(streets.blocks.buffer(from_wall_m, quad_segs=_ROUND))
    lines = shapely.line_merge(around.boundary.intersection(along), directed=True)
    parts = shapely.get_parts(lines)
    return tuple(shapely.get_coordinates(part) for part in parts if part.geom_type == "LineString")


def cover_of(streets: Streets) -> GroundCover:
    """Returns paving and asphalt as a raster."""
    paved = streets.fabric.union(streets.blocks.buffer(streets.rule.pavement_m, quad_segs=_ROUND))
    if paved.is_empty:
        return GroundCover(np.zeros((0, 0), np.uint8), 0.0, 0.0, 1.0)
    x0, y0, x1, y1 = paved.bounds
    cell = max(_CELL_M, math.sqrt((x1 - x0) * (y1 - y0) / _MAX_CELLS))
    shape = math.ceil((y1 - y0) / cell), math.ceil((x1 - x0) / cell)
    material = np.full(shape, Material.GROUND, dtype=np.uint8)
    material[covered(paved, (x0, y0), cell, shape)] = Material.PAVING
    material[covered(streets.roadway, (x0, y0), cell, shape)] = Material.ASPHALT
    return GroundCover(material, x0, y0, cell)


def covered(
    area: Any, corner: tuple[float, float], cell_m: float, shape: tuple[int, int]
) -> NDArray[np.bool_]:
    """Returns the cells (rows, columns) whose centre lies in a shapely area.

    By the even-odd rule: along each row of cells, every crossing edge changes sides.
    """
    import shapely

    rows, columns = shape
    flips = np.zeros((rows, columns + 1), dtype=np.bool_)
    for ring in shapely.get_rings(shapely.get_parts(area)):
        # in cells, so that the middle of row i lies at v = i
        u, v = (shapely.get_coordinates(ring) - corner).T / cell_m - 0.5
        low, high = np.minimum(v[:-1], v[1:]), np.maximum(v[:-1], v[1:])
        first = np.clip(np.ceil(low), 0, rows).astype(np.int64)
        count = np.clip(np.ceil(high), 0, rows).astype(np.int64) - first
        edge = np.repeat(np.arange(len(count)), count)
        row = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + first[edge]
        fraction = (row - v[edge]) / (v[edge + 1] - v[edge])
        crossing = u[edge] + fraction * (u[edge + 1] - u[edge])
        column = np.clip(np.ceil(crossing), 0, columns).astype(np.int64)
        np.logical_xor.at(flips, (row, column), True)
    return np.asarray(np.logical_xor.accumulate(flips[:, :-1], axis=1))
