"""Compiles the kernels of the SLAM in the plane; see `volery.autonomy.warm_up`."""

from __future__ import annotations

import numpy as np

from volery.autonomy.slam.planar.local_map import LocalMap
from volery.autonomy.slam.planar.scans import thinned
from volery.autonomy.slam.planar.settings import Fitting

_LEVELS = 2


def walls() -> None:
    """All of them: a scan is laid onto a map."""
    points = thinned(np.column_stack([np.linspace(0.0, 1.0, 20), np.ones(20)]), 0.04, 20)
    known = LocalMap(2.0, _LEVELS, Fitting())
    known.draw(points, np.zeros(3))
    known.fit(points, np.zeros(3))
    known.search(points, np.zeros(3), np.full(3, 0.1))
