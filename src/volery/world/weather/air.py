"""The velocity of the air at one UAV: mean wind + gusts + turbulence.

Gusts are here: 1-cosine gusts (MIL-F-8785C, discrete gust model), with equal rise and fall.
"""

from __future__ import annotations

import math
from typing import Any

from volery.core.arrays import Array
from volery.core.compiled import inner_kernel
from volery.world.terrain import TerrainGrid, terrain_height
from volery.world.weather.dryden import turbulent_velocity
from volery.world.weather.mean_wind import FIELD, UNIFORM, mean_wind


@inner_kernel
def air_velocity(
    air: Any,
    nodes: Array,
    grid: TerrainGrid,
    turbulence: Any,
    position: Array,
    velocity: Array,
    tick: int,
    period: float,
) -> tuple[float, float, float]:
    """Returns the velocity (x, y, z) m/s, map, of the air at a UAV during tick number `tick`.

    air: an `AIR`. nodes: its field, (Z, Y, X, 3). turbulence: the UAV's `TURBULENCE`, which is
    advanced. position, velocity: the UAV's, (3,) m and m/s, map. period: s of a tick; gusts are
    evaluated at its middle.
    """
    x, y, z = position[0], position[1], position[2]
    turbulent = air.w20 > 0.0
    height = 0.0
    if turbulent or air.kind not in (UNIFORM, FIELD):
        height = z - terrain_height(grid, x, y)
    wx, wy, wz = mean_wind(air, nodes, position, height)
    x, y, z = wx, wy, wz
    if turbulent:
        u, v, w = turbulent_velocity(
            turbulence,
            air.w20,
            height,
            wx,
            wy,
            wz,
            velocity[0] - wx,
            velocity[1] - wy,
            velocity[2] - wz,
            tick,
            period,
        )
        x += u
        y += v
        z += w
    if air.gusts > 0:
        u, v, w = _gust_velocity(air, position, (tick + 0.5) * period)
        x += u
        y += v
        z += w
    return x, y, z


@inner_kernel
def _gust_velocity(air: Any, position: Array, time: float) -> tuple[float, float, float]:
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
