"""1-cosine gusts (MIL-F-8785C, discrete gust model), with equal rise and fall."""

from __future__ import annotations

import math
from typing import Any

from volery.core.arrays import Array
from volery.core.compiled import inner_kernel


@inner_kernel
def gust_velocity(air: Any, position: Array, time: float) -> tuple[float, float, float]:
    """Returns the sum (x, y, z) m/s, map, of an `AIR` record's gusts.

    position: (3,) m, map. time: s.
    """
    x = y = z = 0.0
    for g in range(air.gusts):
        since = time - air.gust_start[g]
        for k in range(3):
            since -= air.gust_slowness[g, k] * position[k]
        left = air.gust_length[g] - since
        if since > 0.0 and left > 0.0:
            phase = min(since, left) * air.gust_inverse_rise[g]
            fraction = 1.0 if phase >= 1.0 else 0.5 - 0.5 * math.cos(math.pi * phase)
            x += fraction * air.gust_amplitude[g, 0]
            y += fraction * air.gust_amplitude[g, 1]
            z += fraction * air.gust_amplitude[g, 2]
    return x, y, z
