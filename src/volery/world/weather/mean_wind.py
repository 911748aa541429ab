"""The mean wind at a position: steady, by a profile over height, or from a field."""

from __future__ import annotations

import math
from typing import Any

from volery.core.arrays import Array
from volery.core.compiled import inner_kernel
from volery.world.weather.wind_field import field_velocity

UNIFORM, LOG, POWER, FIELD = 0, 1, 2, 3
"""Kinds of mean wind."""
_TOP = 304.8
"""Height above ground (1000 ft) beyond which profiles are constant, m (MIL-F-8785C)."""


@inner_kernel
def mean_wind(air: Any, nodes: Array, position: Array, height: float) -> tuple[float, float, float]:
    """Returns the velocity (x, y, z) m/s, map, at `position` (3,) m, `height` m above ground.

    air: an `AIR` record. nodes: its field, (Z, Y, X, 3).
    """
    if air.kind == FIELD:
        return field_velocity(air, nodes, position)
    factor = 1.0
    if air.kind == LOG:
        # profile_shape: roughness, m. profile_scale: 1 / ln(reference / roughness)
        above = min(max(height, air.profile_shape), _TOP)
        factor = math.log(above / air.profile_shape) * air.profile_scale
    elif air.kind == POWER:
        # profile_shape: exponent. profile_scale: 1 / reference, 1/m
        above = min(max(height, 0.0), _TOP)
        factor = (above * air.profile_scale) ** air.profile_shape
    return factor * air.velocity[0], factor * air.velocity[1], factor * air.velocity[2]
