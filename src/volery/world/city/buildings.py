"""Closed solids from footprints: walls, flat roofs, and a floor below the ground or above it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from volery.core.arrays import Array
from volery.core.rng import generator
from volery.world.city.outline import Outline
from volery.world.materials import Material
from volery.world.mesh import Mesh, concatenate
from volery.world.scene_content import Look, Solid
from volery.world.terrain import Terrain

FOUNDATION_M = 0.5
"""Depth of walls below the lowest ground, so that nothing passes under them."""
_LOOK_EVERY_M = 5.0
"""Distance of the points along an outline at which the ground is sampled."""
_PLASTER = (
    (0.98, 0.90, 0.70),
    (0.95, 0.78, 0.50),
    (0.86, 0.84, 0.78),
    (0.92, 0.72, 0.58),
    (0.74, 0.76, 0.72),
    (0.70, 0.44, 0.34),
    (1.00, 0.96, 0.88),
)
"""Linear colours of walls (modelling choice): cream, ochre, greys, rose, brick, white."""


@dataclass(frozen=True, eq=False)
class Building:
    """A building in the map.

    foot_m: minimum z of the ground along its outline. roof_m: z of its flat roof.
    """

    outline: Outline
    foot_m: float
    roof_m: float

    @property
    def floor_m(self) -> float:
        """Height of the lower side in the map: below the ground, or above it for floating ones."""
        base = self.outline.height.base_m
        return self.foot_m + base if base > 0.0 else self.foot_m - FOUNDATION_M

    @property
    def area_m2(self) -> float:
        """Area of the footprint."""
        return float(self.outline.footprint.area)


def stand(outlines: Sequence[Outline], terrain: Terrain) -> tuple[Building, ...]:
    """Returns buildings on the ground; heights count from the lowest ground along an outline."""
    import shapely

    if not outlines:
        return ()
    lines = shapely.segmentize([outline.footprint for outline in outlines], _LOOK_EVERY_M)
    points, owner = shapely.get_coordinates(lines, return_index=True)
    feet = np.full(len(outlines), np.inf)
    np.minimum.at(feet, owner, terrain.height(points[:, 0], points[:, 1]))
    return tuple(
        Building(outline, float(foot), float(foot) + outline.height.height_m)
        for outline, foot in zip(outlines, feet, strict=True)
    )


def solids_of(buildings: Sequence[Building], seed: int) -> tuple[Solid, ...]:
    """Returns a closed solid for each building, with "building" and its id as name."""
    picks = generator(seed, "city/plaster").integers(0, len(_PLASTER), len(buildings))
    return tuple(
        Solid(
            mesh=extruded(building.outline.footprint, building.floor_m, building.roof_m),
            material=Material.FACADE,
            name=f"building {building.outline.id}",
            top=Material.ROOF,
            look=Look(
                colour=_PLASTER[pick],
                foot_m=building.foot_m,
                storey_m=building.outline.height.storey_m,
                storeys=building.outline.height.storeys,
            ),
        )
        for building, pick in zip(buildings, picks.tolist(), strict=True)
    )


def extruded(footprint: Any, low_m: float, high_m: float) -> Mesh:
    """Returns the closed mesh over disjoint shapely polygons, facing outwards.

    Outer rings run counter-clockwise, holes clockwise, as `shapely.orient_polygons` returns them.
    """
    import shapely

    polygons = shapely.get_parts(footprint)
    rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(polygons)]
    walls = [_wall(ring, low_m, high_m) for ring in rings]
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(polygons))
    pieces = shapely.get_parts(pieces)
    flat = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]
    across = np.diff(flat, axis=1)
    clockwise = across[:, 0, 0] * across[:, 1, 1] < across[:, 0, 1] * across[:, 1, 0]
    flat[clockwise] = flat[clockwise, ::-1]
    return concatenate([*walls, _level(flat, high_m), _level(flat[:, ::-1], low_m)])


def _wall(ring: Array, low_m: float, high_m: float) -> Mesh:
    """Returns upright rectangles along a closed ring (n, 2), facing its right."""
    count = len(ring) - 1
    corners = np.empty((count, 4, 3))
    for k, (along, height) in enumerate(itertools.product((ring[:-1], ring[1:]), (low_m, high_m))):
        corners[:, k, :2] = along
        corners[:, k, 2] = height
    first = 4 * np.arange(count, dtype=np.uint32)[:, None, None]
    quads = first + np.array([[0, 2, 3], [0, 3, 1]], dtype=np.uint32)
    return Mesh(corners.reshape(-1, 3).astype(np.float32), quads.reshape(-1, 3))


def _level(triangles: Array, height_m: float) -> Mesh:
    """Returns triangles (n, 3, 2) at a height."""
    points = np.full((3 * len(triangles), 3), height_m)
    points[:, :2] = triangles.reshape(-1, 2)
    return Mesh(points.astype(np.float32), np.arange(len(points), dtype=np.uint32).reshape(-1, 3))
