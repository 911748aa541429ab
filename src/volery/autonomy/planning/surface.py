"""The surface that a vehicle flies on: parallel to the ground, at a height above it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from volery.core.arrays import Array


class Surface(NamedTuple):
    """Plane z = level + slope . (x, y), m."""

    level: float
    slope: Array
    """(2,)."""

    def height_at(self, xy: Array) -> Array:
        """Returns the heights (...,) m at positions (..., 2) m."""
        return np.asarray(self.level + xy @ self.slope)
