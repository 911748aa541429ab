"""The velocity of the air at one UAV: mean wind + gusts + turbulence."""

from __future__ import annotations

from typing import Any

from volery.core.arrays import Array
from volery.core.compiled import inner_kernel
from volery.world.terrain import TerrainGrid, terrain_height
from volery.world.weather.dryden import turbulent_velocity
from volery.world.weather.gusts import gust_velocity
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
        u, v, w = gust_velocity(air, position, (tick + 0.5) * period)
        x += u
        y += v
        z += w
    return x, y, z
