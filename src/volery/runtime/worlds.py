"""Builds terrain and forest of a scenario."""

from __future__ import annotations

from pathlib import Path

from volery.core.errors import DataFileError, ScenarioError, VoleryError
from volery.scenario.files import resolve
from volery.scenario.schema import GridTerrain, InventoryForest, ProceduralForest, Scenario
from volery.world.forest import Forest, forest_from_inventory, procedural_forest
from volery.world.terrain import Terrain

SHIPPED_DATA = Path(__file__).resolve().parent.parent / "world" / "data"


def build_terrain(scenario: Scenario) -> Terrain:
    """Ground of the scenario."""
    terrain = scenario.world.terrain
    if isinstance(terrain, GridTerrain):
        try:
            path = resolve(terrain.file, scenario.folder, SHIPPED_DATA)
            return Terrain.from_csv(path, terrain.spacing_m, origin=terrain.origin_m)
        except DataFileError as error:
            raise DataFileError(f"{scenario.name}: world.terrain: {error}") from None
    reach = terrain.extent_m
    return Terrain.flat(2.0 * reach, terrain.height_m, origin=(-reach, -reach))


def build_forest(scenario: Scenario, terrain: Terrain) -> Forest | None:
    """Trees of the scenario, None where it has no forest.

    Raises `ScenarioError` where the forest cannot grow, has no trees or reaches beyond the terrain.
    """
    try:
        forest = _grow(scenario, terrain)
    except VoleryError as error:
        raise ScenarioError(f"{scenario.name}: world.forest: {error}") from None
    if isinstance(scenario.world.forest, InventoryForest) and not forest:
        raise ScenarioError(f"{scenario.name}: world.forest: the inventory has no tree there")
    if forest:
        x0, y0, x1, y1 = terrain.bounds
        x, y = forest.position_map[:, 0], forest.position_map[:, 1]
        outside = int(((x < x0) | (x > x1) | (y < y0) | (y > y1)).sum())
        if outside:
            raise ScenarioError(
                f"{scenario.name}: world.forest: {outside} trees stand beyond the terrain, which "
                f"reaches from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m; region_m crops an inventory"
            )
    return forest


def _grow(scenario: Scenario, terrain: Terrain) -> Forest | None:
    forest = scenario.world.forest
    if isinstance(forest, InventoryForest):
        return forest_from_inventory(
            resolve(forest.file, scenario.folder, SHIPPED_DATA),
            region=forest.region_m,
            species=forest.species,
            seed=scenario.world_seed,
            terrain=terrain,
        )
    if isinstance(forest, ProceduralForest):
        return procedural_forest(
            forest.region_m,
            trees=forest.trees,
            minimum_spacing_m=forest.minimum_spacing_m,
            species=forest.species,
            seed=scenario.world_seed,
            terrain=terrain,
        )
    return None
