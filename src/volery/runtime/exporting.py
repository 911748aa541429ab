"""The world of a scenario as a file."""

from __future__ import annotations

from pathlib import Path

from volery.runtime.worlds import build_city, build_forest, build_solids, build_terrain
from volery.scenario.schema import Scenario
from volery.sensors.cameras.light import base_colours
from volery.world.gltf import glb_of
from volery.world.ground_cover import BARE_GROUND
from volery.world.trees.model import DetailLevel


def export_world(
    scenario: Scenario, path: Path, *, detail: DetailLevel = DetailLevel.SENSING
) -> int:
    """Write ground, trees and solids as binary glTF; the number of bytes.

    Raises `VoleryError` where the world cannot be built, `OSError` where the file cannot be
    written.
    """
    terrain = build_terrain(scenario)
    city = build_city(scenario, terrain)
    forest = build_forest(scenario, terrain, city)
    solids = build_solids(scenario, terrain, city)
    cover = BARE_GROUND if city is None else city.cover
    content = glb_of(terrain, forest, solids, colours=base_colours(), cover=cover, detail=detail)
    return path.write_bytes(content)
