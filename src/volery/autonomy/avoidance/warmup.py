"""Warmup tasks for the kernels that find gaps between obstacles."""

from __future__ import annotations

import numpy as np

from volery.autonomy.avoidance.gaps import free_distances
from volery.autonomy.avoidance.obstacle_memory import ObstacleMemory


def gaps() -> None:
    """Compiles the kernels that find gaps between obstacles, for any sensor."""
    obstacles = ObstacleMemory()
    obstacles.add(np.zeros((1, 3)), 0)
    free_distances(obstacles.around(np.zeros(3), 0, 1.0), 1.0, 1.0)
