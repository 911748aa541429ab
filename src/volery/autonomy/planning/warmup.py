"""Compiles the kernels of the planners; see `volery.autonomy.perception.warmup`."""

from __future__ import annotations

import numpy as np

from volery.autonomy.perception.warmup import some_rays
from volery.autonomy.planning.clearance import clearance_of
from volery.autonomy.planning.local_grid import LocalGrid
from volery.autonomy.planning.primitives import MotionLimits, PrimitiveState
from volery.autonomy.planning.receding_horizon import (
    Observations,
    PlannerSettings,
    RecedingHorizonPlanner,
)
from volery.autonomy.planning.reciprocal_avoidance import half_plane
from volery.autonomy.planning.search_area import SearchArea
from volery.autonomy.planning.surface import Surface
from volery.autonomy.planning.voxel_space import SolidVoxels, VoxelSpace
from volery.core.arrays import read_only

_SHAPE = (8, 8, 8)


def searched_area() -> None:
    """Compiles the kernels of the search area."""
    area = SearchArea(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]), 1.0)
    area.look(np.zeros(3), read_only(np.zeros((2, 2), np.int8)), np.zeros(2), 1.0, 1.0)
    area.gains(np.zeros((1, 2)), 1.0)


def path_planning() -> None:
    """Compiles the kernels of the path planning space."""
    space = VoxelSpace(SolidVoxels(np.zeros((1, 3)), np.ones(1)), 0.4, np.zeros((1, 2)), 2.0)
    space.is_free(0.0, 0.0, 1.0, 0.1)
    space.is_free_leg(0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 0.1)


def plans() -> None:
    """Compiles the kernels of local planning."""
    grid, here = LocalGrid(0.25, _SHAPE), np.zeros(3)
    grid.move_to(here)
    grid.add(some_rays())
    grid.clear_around(here, 0.5)
    clearance = clearance_of(*grid.window(here, _SHAPE), grid.cell_m, 1)
    planning = RecedingHorizonPlanner(PlannerSettings(MotionLimits(1.0, 1.0, 1.0, 1.0, 1.0)))
    at_rest = PrimitiveState(here, np.zeros(3), np.zeros(3))
    start = planning.start(at_rest, 0.0, 0, 0)
    half_plane(1.0, 0.0, 1.0, 0.0, 1.0, 1.0, 1.0)
    planning.plan(start, np.ones(2), Observations(clearance, Surface(0.0, np.zeros(2)), []), 0)
