"""Compiles the kernels of the maps; see `volery.autonomy.perception.warmup`."""

from __future__ import annotations

import numpy as np

from volery.autonomy.mapping.log_odds import LogOddsGrid
from volery.autonomy.mapping.merging import PlacedMap, merged
from volery.autonomy.mapping.octomap_stream import Voxels, decode_binary, decode_full
from volery.autonomy.mapping.octree import Octree
from volery.autonomy.mapping.projected_grid import HeightSlab, ProjectedGrid
from volery.autonomy.perception.warmup import some_rays
from volery.core.arrays import read_only

_MAX_RANGE_M = 15.0


def growing_map() -> None:
    """Compiles the kernels of a map that grows until cells are dropped."""
    rays = some_rays()
    tree = Octree(0.2, max_nodes=1)
    tree.insert(rays, _MAX_RANGE_M)
    tree.binary()
    grid = ProjectedGrid(0.4, 4.0)
    grid.begin_at(np.zeros(3))
    grid.add(rays, HeightSlab(0.0, np.zeros(2), 0.6))


def read_maps() -> None:
    """Compiles the kernels that read another node's maps."""
    empty = read_only(np.zeros(0, np.uint8))
    decode_binary(empty)
    decode_full(empty)


def merged_maps() -> None:
    """Compiles the kernel that writes merged maps."""
    cell = np.zeros((1, 3), np.int32), np.ones(1, np.int32), np.ones(1, np.bool_)
    merged([PlacedMap(Voxels(*cell))], 0.2, 8)


def drawn_scans() -> None:
    """Compiles the kernel of the grids that reports draw."""
    grid = LogOddsGrid(np.zeros(2), np.ones(2), 0.1)
    grid.add(np.zeros((1, 2)), np.ones((1, 2)), np.ones(1, np.bool_))
