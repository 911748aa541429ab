"""Compiles the kernels of the planar SLAM; see `volery.autonomy.perception.warmup`."""

from __future__ import annotations

import numpy as np

from volery.autonomy.perception.static_transforms import LEVEL
from volery.autonomy.perception.warmup import a_scan
from volery.autonomy.slam import messages
from volery.autonomy.slam.planar.local_map import PlanarSubmap
from volery.autonomy.slam.planar.scans import returns, thinned
from volery.autonomy.slam.planar.settings import MatchingSettings, ReturnSettings
from volery.core import rotations

_LEVELS = 2


def walls() -> None:
    """Compiles the kernels that match a scan with a map."""
    points = np.zeros((0, 2))
    for per_beam_s in (0.0, 0.001):  # beams at once, or one after the other
        scan = a_scan()
        scan.time_increment = per_beam_s
        points = thinned(returns(scan, LEVEL, np.zeros(3), ReturnSettings()), 0.04, 20)
    known = PlanarSubmap(2.0, _LEVELS, MatchingSettings())
    known.draw(points, np.zeros(3))
    known.fit(points, np.zeros(3))
    known.search(points, np.zeros(3), np.full(3, 0.1))


def place_recognition() -> None:
    """Compiles the kernel that selects the covariance of a message."""
    nowhere = np.zeros(3), rotations.IDENTITY, np.zeros(3), np.zeros(3)
    messages.odometry(0, "uav1", nowhere, np.zeros((9, 9)))
