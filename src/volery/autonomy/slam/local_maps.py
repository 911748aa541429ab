"""Local maps around the vehicle: uprights and ground."""

from __future__ import annotations

import numpy as np

from volery.autonomy.slam.ground_kernels import GROUND_CELLS
from volery.autonomy.slam.upright_kernels import CELLS, LAYERS


class Submaps:
    """Holds both maps as tables that kernels fill, in the frame of the odometry."""

    def __init__(self) -> None:
        self.upright_keys = np.full((CELLS, CELLS, LAYERS), -1, np.int64)
        self.cells = np.zeros((CELLS, CELLS, LAYERS, 6), np.float32)
        self.ground_keys = np.full((GROUND_CELLS, GROUND_CELLS), -1, np.int64)
        self.sums = np.zeros((GROUND_CELLS, GROUND_CELLS, 9))
