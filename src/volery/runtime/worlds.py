"""Builds terrain and forest of a scenario."""

from __future__ import annotations

from pathlib import Path

from volery.scenario.files import resolve
from volery.scenario.schema import GridTerrain, InventoryForest, ProceduralForest, Scenario
from volery.world.forest import Forest, forest_from_inventory, procedural_forest
from volery.world.terrain import Terrain

SHIPPED_DATA = Path(__file__).resolve().parent.parent / "world" / "data"


def build_terrain(scenario: Scenario) -> Terrain:
    """Ground of the scenario."""
    terrain = scenario.world.terrain
    if isinstance(terrain, GridTerrain):
        path = resolve(terrain.file, scenario.folder, SHIPPED_DATA)
        return Terrain.from_csv(path, terrain.spacing_m, origin=terrain.origin_m)
    return Terrain.flat(extent_m=terrain.extent_m, height_m=terrain.height_m)


def build_forest(scenario: Scenario, terrain: Terrain) -> Forest | None:
    """Trees of the scenario, None where it has no forest."""
    forest = scenario.world.forest
    if isinstance(forest, InventoryForest):
        return forest_from_inventory(
            resolve(forest.file, scenario.folder, SHIPPED_DATA),
            region=forest.region_m,
            species=forest.species,
            seed=scenario.seed,
            terrain=terrain,
        )
    if isinstance(forest, ProceduralForest):
        return procedural_forest(
            forest.region_m,
            trees=forest.trees,
            minimum_spacing_m=forest.minimum_spacing_m,
            species=forest.species,
            seed=scenario.seed,
            terrain=terrain,
        )
    return None
