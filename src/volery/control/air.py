"""The air around the UAVs, looked up anew at each guidance tick."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.vehicle.compiled import inner_kernel
from volery.world.terrain import TerrainGrid
from volery.world.weather.air import air_velocity


@inner_kernel
def refresh_air(
    uav: Any,
    downwash: float,
    air: Any,
    nodes: NDArray[np.float64],
    grid: TerrainGrid,
    tick: int,
    period: float,
) -> None:
    """Set `air_velocity_map` of a `UAV` record; it keeps that until the next tick.

    downwash: m/s of the air that other UAVs push down. air, nodes: the weather, see
    `world.weather.table`. tick: number of this guidance tick since the start. period: s of a tick.
    """
    body = uav.body
    if air.steady:
        x, y, z = air.velocity[0], air.velocity[1], air.velocity[2]
    else:
        x, y, z = air_velocity(
            air,
            nodes,
            grid,
            uav.turbulence,
            body.position_map,
            body.velocity_map,
            tick - uav.turbulence.first_tick,
            period,
        )
    body.air_velocity_map[0] = x
    body.air_velocity_map[1] = y
    body.air_velocity_map[2] = z - downwash
