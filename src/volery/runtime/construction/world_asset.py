"""Exports the geometry of a running world as glTF for renderers."""

from __future__ import annotations

from typing import Any

import numpy as np

from volery.runtime.construction.geometry import Geometry
from volery.runtime.construction.worlds import build_weather, sun_in
from volery.scenario.schema import Scenario
from volery.sensors.cameras.light import base_colours
from volery.world.gltf import instanced_glb_of
from volery.world.trees.model import DetailLevel


def asset_of(
    scenario: Scenario, geometry: Geometry, detail: DetailLevel = DetailLevel.SENSING
) -> bytes:
    """Returns binary glTF; the asset's `extras` hold bounds, sun, geographic origin and kind."""
    return instanced_glb_of(
        geometry.terrain,
        geometry.forest,
        geometry.solids,
        colours=base_colours(),
        cover=geometry.cover,
        detail=detail,
        extras=_extras(scenario, geometry, detail),
    )


def kind_of(scenario: Scenario) -> str:
    """Returns `grid_map`, `city`, `forest` or `open`."""
    world = scenario.world
    kinds = {"grid_map": world.grid_map, "city": world.city, "forest": world.forest}
    return next((kind for kind, part in kinds.items() if part is not None), "open")


def _extras(scenario: Scenario, geometry: Geometry, detail: DetailLevel) -> dict[str, Any]:
    world = scenario.world
    elevation_deg, azimuth_deg = sun_in(world, build_weather(scenario))
    low, high = _bounds(geometry)
    return {
        "world": geometry.id,
        "kind": kind_of(scenario),
        "scenario": scenario.name,
        "detail": str(detail),
        "trees": 0 if geometry.forest is None else len(geometry.forest),
        "bounds_enu_m": {"min": low, "max": high},
        "sun": {"elevation_deg": elevation_deg, "azimuth_deg": azimuth_deg},
        "origin": world.origin.model_dump(),
    }


def _bounds(geometry: Geometry) -> tuple[list[float], list[float]]:
    """Returns the min and max corner of the geometry, m, map."""
    x0, y0, x1, y1 = geometry.terrain.bounds
    heights = geometry.terrain.grid.heights
    corners = [np.array([x0, y0, heights.min()]), np.array([x1, y1, heights.max()])]
    forest = geometry.forest
    if forest is not None and len(forest):
        tops = forest.position_map[:, 2] + forest.height_m
        corners.append(np.array([x0, y0, tops.max()]))
    for solid in geometry.solids:
        corners += list(solid.mesh.bounds) if len(solid.mesh) else []
    return (
        np.min(corners, axis=0).round(2).tolist(),
        np.max(corners, axis=0).round(2).tolist(),
    )
