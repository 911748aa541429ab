"""Detections of one tag in K images."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array


class TagDetections(NamedTuple):
    """Detections of one tag in K images."""

    is_detected: NDArray[np.bool_]
    """(K,)."""
    position_optical: Array
    """(K, 3) m, zeros without a detection."""
    attitude_optical: Array
    """(K, 4) optical frame from tag."""


def no_detections(count: int) -> TagDetections:
    """Returns K images without a tag."""
    identity = np.broadcast_to([0.0, 0.0, 0.0, 1.0], (count, 4)).copy()
    return TagDetections(np.zeros(count, np.bool_), np.zeros((count, 3)), identity)
