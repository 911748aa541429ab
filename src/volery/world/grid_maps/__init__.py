"""Worlds from 0/1 matrices: grid maps, their files, and their blocks."""

from __future__ import annotations

from volery.world.grid_maps.blocks import block_mesh
from volery.world.grid_maps.grid_map import GridMap
from volery.world.grid_maps.map_server import read_map_server
from volery.world.grid_maps.parsing import read_cells

__all__ = ["GridMap", "block_mesh", "read_cells", "read_map_server"]
