"""Converts depth images from metres to whole millimetres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_MAX_MM = 65535


def millimetres(depth: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Converts depth (..., height, width), m, to mm (REP 118); 0: unknown, or beyond 65.535 m."""
    with np.errstate(invalid="ignore"):
        scaled = np.rint(depth * np.float32(1000.0))
        known = (scaled > 0.0) & (scaled <= _MAX_MM)
    return np.where(known, scaled, 0.0).astype(np.uint16)
