"""Compiled texture of outer walls: storeys of windows by height and by distance along the wall.

Bays have one width everywhere and are counted along the wall's direction from the map's origin, so
that the texture depends on the hit point alone; a corner may cut a window. All numbers are
modelling choices.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.compiled import inner_kernel
from volery.sensors.cameras.light import GRAIN, Light

f4 = np.float32
_BAY_M = np.float32(2.6)
_MASK = GRAIN - 1
_PIXEL = np.float32(0.0015)
"""Angle over which edges are softened, rad: about a pixel of a usual camera, against flicker."""
_MULLION_M = np.float32(0.04)


@inner_kernel
def _within(offset: Any, half: Any, edge: Any) -> Any:
    """Returns 1 for `offset` from the middle below `half`, 0 above, soft over `edge`, all m."""
    return min(max((half - abs(offset)) / edge + f4(0.5), f4(0.0)), f4(1.0))


@inner_kernel
def pane_fraction(
    look: NDArray[np.float32], x: Any, y: Any, z: Any, nx: Any, ny: Any, distance: Any
) -> tuple[Any, Any]:
    """Returns the fraction of glass at a wall's point, 0 to 1, and the number of its window.

    look: row of `scene_content.Look`. (x, y, z) m, map; (nx, ny) of the wall's normal; distance in
    m.
    """
    up = (z - look[3]) / look[4]
    row = np.floor(up)
    if row < f4(0.0) or row >= look[5]:
        return f4(0.0), np.int64(0)
    along = (y * nx - x * ny) / _BAY_M
    bay = np.floor(along)
    aside = (along - bay - f4(0.5)) * _BAY_M
    above = (up - row - f4(0.55)) * look[4]
    # shops on the ground floor have wider and lower panes
    half_width, half_height = f4(0.65), f4(0.26) * look[4]
    if row == f4(0.0):
        half_width, above, half_height = f4(1.0), above + f4(0.1) * look[4], f4(0.32) * look[4]
    edge = max(distance * _PIXEL, f4(0.01))
    fraction = _within(aside, half_width, edge) * _within(above, half_height, edge)
    bar = _within(aside, _MULLION_M, edge) * min(_MULLION_M / edge, f4(1.0))
    return fraction * (f4(1.0) - bar), np.int64(bay) * 31 + np.int64(row) * 17


@inner_kernel
def pane_light(light: Light, j: int, dz: Any, window: Any) -> Any:
    """Returns channel `j` of a pane's reflection of a ray with slope `dz`: sky or street."""
    dim = f4(0.12) + f4(0.25) * light.grain[window & _MASK, (window >> 6) & _MASK]
    horizon = light.horizon[j]
    if dz > f4(0.0):
        return dim * (horizon + np.sqrt(dz) * (light.zenith[j] - horizon))
    return dim * f4(0.4) * horizon
