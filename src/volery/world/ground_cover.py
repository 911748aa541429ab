"""Materials of the ground other than bare earth: a raster over the map."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inline_kernel
from volery.world.materials import Material

_EARTH = int(Material.GROUND)


class GroundCover(NamedTuple):
    """Square cells (rows along y, columns along x); beyond them the ground is earth."""

    material: NDArray[np.uint8]
    """(rows, columns) `Material` of each cell."""
    origin_x: float
    """Lower left corner of the first cell, m."""
    origin_y: float
    spacing: float
    """Side of a cell, m."""


BARE_GROUND = GroundCover(np.zeros((0, 0), np.uint8), 0.0, 0.0, 1.0)
"""Earth everywhere."""


@inline_kernel
def ground_material(cover: GroundCover, x: float, y: float) -> int:
    """Returns the `Material` of the ground at map position (x, y)."""
    material, origin_x, origin_y, spacing = cover
    rows, columns = material.shape
    u, v = (x - origin_x) / spacing, (y - origin_y) / spacing
    if u < 0.0 or v < 0.0 or u >= columns or v >= rows:
        return _EARTH
    return int(material[int(v), int(u)])
