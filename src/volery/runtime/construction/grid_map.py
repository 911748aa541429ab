"""Builds the blocks of a scenario's grid maps."""

from __future__ import annotations

import math

from volery.core.errors import CommandError, DataFileError, ScenarioError
from volery.scenario.grid_map import GridMapFile
from volery.scenario.schema import Scenario
from volery.world.grid_maps import GridMap, block_mesh, read_cells, read_map_server
from volery.world.materials import Material
from volery.world.scene import Solid
from volery.world.terrain import Terrain

BLOCK_NAME = "block"
"""Name of all blocks in contact events."""


def read_grid_map(scenario: Scenario, entry: GridMapFile) -> GridMap:
    """Returns a map as at the start. Raises `ScenarioError` or `DataFileError`."""
    world = scenario.world.grid_map
    assert world is not None
    key = f"{scenario.name}: world.grid_map.maps: '{entry.called}'"
    try:
        path = scenario.access.find_file(entry.file)
        if path.suffix.lower() in (".yaml", ".yml"):
            file = read_map_server(path)
            cells = file.blocked | file.unknown if world.unknown_is_blocked else file.blocked
            own = file.cell_m, world.block_height_m, file.origin_m, file.yaw_rad
            return GridMap(entry.called, cells, *own)
        cells = read_cells(path, entry.threshold)
        return GridMap(entry.called, cells, world.cell_size_m, world.block_height_m, world.origin_m)
    except DataFileError as error:
        raise DataFileError(f"{key}: {error}") from None
    except CommandError as error:
        raise ScenarioError(f"{key}: {error}") from None


def starting_grid_map(scenario: Scenario) -> GridMap | None:
    """Returns the map at the start; None without one."""
    world = scenario.world.grid_map
    if world is None or world.starting is None:
        return None
    entry = next(each for each in world.maps if each.called == world.starting)
    return read_grid_map(scenario, entry)


def starting_blocks(scenario: Scenario, terrain: Terrain) -> tuple[Solid, ...]:
    """Returns the blocks at the start. Raises `ScenarioError` if they exceed the terrain."""
    grid = starting_grid_map(scenario)
    if grid is None:
        return ()
    try:
        return blocks_of(grid, terrain)
    except CommandError as error:
        raise ScenarioError(f"{scenario.name}: world.grid_map: {error}") from None


def blocks_of(grid: GridMap, terrain: Terrain) -> tuple[Solid, ...]:
    """Returns the blocks of a map as one solid; no solid if no cell is blocked.

    They stand on the ground and extend from its lowest point below them to `block_height_m` above
    its highest one. Raises `CommandError` if they exceed the terrain.
    """
    bounds = grid.bounds_of_blocks()
    if bounds is None:
        return ()
    x0, y0, x1, y1 = terrain.bounds
    inside = x0 <= bounds[0] and y0 <= bounds[1] and bounds[2] <= x1 and bounds[3] <= y1
    if not inside:
        extent = "({:g}, {:g}) to ({:g}, {:g})".format(*bounds)
        raise CommandError(
            f"grid map '{grid.name}': its blocks extend from {extent} m, beyond the terrain, which "
            f"extends from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m"
        )
    lowest, highest = _heights_below(bounds, terrain)
    mesh = block_mesh(grid, lowest, highest + grid.block_height_m)
    return (Solid(mesh, Material.BLOCK, BLOCK_NAME),)


def _heights_below(
    bounds: tuple[float, float, float, float], terrain: Terrain
) -> tuple[float, float]:
    """Returns the min and max z of the terrain's grid points around a rectangle."""
    heights, x0, y0, spacing = terrain.grid
    j0, j1 = math.floor((bounds[0] - x0) / spacing), math.ceil((bounds[2] - x0) / spacing)
    i0, i1 = math.floor((bounds[1] - y0) / spacing), math.ceil((bounds[3] - y0) / spacing)
    below = heights[i0 : i1 + 1, j0 : j1 + 1]
    return float(below.min()), float(below.max())
