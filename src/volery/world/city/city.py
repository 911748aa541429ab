"""Builds a city from building outlines, a ground and a seed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import DataFileError
from volery.core.geodesy import LocalFrame
from volery.core.plurals import counted
from volery.world.city.buildings import Building, solids_of, stand
from volery.world.city.furniture import FurnitureRule, lamp_solids, place_lamps, place_trees
from volery.world.city.heights import HeightRule
from volery.world.city.outlines import Region, Report, read_outlines
from volery.world.city.streets import StreetRule, cover_of, find_streets
from volery.world.ground_cover import GroundCover
from volery.world.inventory import Inventory
from volery.world.scene_content import Solid
from volery.world.terrain import Terrain


@dataclass(frozen=True, eq=False)
class City:
    """A city on its ground, in the map.

    solids: one per building, then one per lamp. lamps: (L, 4) position and direction of the arm.
    trees: street trees, which join the forest. report: results of reading the outlines.
    """

    buildings: tuple[Building, ...]
    lamps: NDArray[np.float64]
    trees: Inventory
    cover: GroundCover
    solids: tuple[Solid, ...]
    report: Report


def build_city(
    path: str | Path,
    frame: LocalFrame,
    terrain: Terrain,
    *,
    seed: int = 0,
    region: Region | None = None,
    heights: HeightRule | None = None,
    streets: StreetRule | None = None,
    furniture: FurnitureRule | None = None,
) -> City:
    """Builds the city of a GeoJSON file of outlines; `frame` is the map's position on the earth.

    region: (x0, y0, x1, y1) in m; only buildings whose centre lies in it are used. None uses all.
    Raises `DataFileError` if the file is invalid, contains no building there, or has buildings
    beyond the terrain.
    """
    outlines, report = read_outlines(path, frame, rule=heights or HeightRule(), region=region)
    if not outlines:
        raise DataFileError(f"{path}: no building is left\n  {report}")
    x0, y0, x1, y1 = terrain.bounds
    boxes = np.array([outline.footprint.bounds for outline in outlines])
    beyond = ((boxes < (x0, y0, x0, y0)) | (boxes > (x1, y1, x1, y1))).any(axis=1)
    if beyond.any():
        first = outlines[int(np.argmax(beyond))].id
        raise DataFileError(
            f"{path}: {counted(int(beyond.sum()), 'building')}, {first} for one, "
            f"beyond the terrain, which ends at ({x0:g}, {y0:g}) and ({x1:g}, {y1:g}) m; "
            "region_m crops the outlines"
        )
    rule = furniture or FurnitureRule()
    buildings = stand(outlines, terrain)
    found = find_streets([outline.footprint for outline in outlines], streets or StreetRule())
    lamps = place_lamps(found, rule, seed)
    lamps = lamps[_on(terrain, lamps)]
    trees = place_trees(found, rule, seed, lamps)
    return City(
        buildings=buildings,
        lamps=lamps,
        trees=trees.within((x0, y0, x1, y1)),
        cover=cover_of(found),
        solids=solids_of(buildings, seed) + lamp_solids(lamps, terrain),
        report=report,
    )


def _on(terrain: Terrain, positions: NDArray[np.float64]) -> NDArray[np.bool_]:
    x0, y0, x1, y1 = terrain.bounds
    x, y = positions[:, 0], positions[:, 1]
    return np.asarray((x >= x0) & (x < x1) & (y >= y0) & (y < y1))
