"""Local maps around the vehicle: uprights and ground."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from volery.autonomy.slam.ground_kernels import GROUND_CELLS, Keys
from volery.autonomy.slam.upright_kernels import CELLS, LAYERS, Cells
from volery.core.arrays import Array


class Submaps(NamedTuple):
    """Holds both maps as tables that kernels fill, in the frame of the odometry."""

    upright_keys: Keys
    cells: Cells
    ground_keys: Keys
    sums: Array

    @classmethod
    def empty(cls) -> Submaps:
        """Returns maps without returns."""
        return cls(
            np.full((CELLS, CELLS, LAYERS), -1, np.int64),
            np.zeros((CELLS, CELLS, LAYERS, 6), np.float32),
            np.full((GROUND_CELLS, GROUND_CELLS), -1, np.int64),
            np.zeros((GROUND_CELLS, GROUND_CELLS, 9)),
        )
