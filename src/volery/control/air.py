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
    uavs: NDArray[np.void],
    air: Any,
    nodes: NDArray[np.float64],
    grid: TerrainGrid,
    tick: int,
    period: float,
) -> None:
    """Set `air_velocity_map` of every UAV that is awake; it keeps that until the next tick.

    air, nodes: the weather, see `world.weather.table`. tick: number of this guidance tick since the
    start. period: s of a tick.
    """
    for i in range(uavs.shape[0]):
        body = uavs[i].body
        if body.asleep:
            continue
        if air.steady:
            x, y, z = air.velocity[0], air.velocity[1], air.velocity[2]
        else:
            x, y, z = air_velocity(
                air,
                nodes,
                grid,
                uavs[i].turbulence,
                body.position_map,
                body.velocity_map,
                tick - uavs[i].turbulence.first_tick,
                period,
            )
        body.air_velocity_map[0] = x
        body.air_velocity_map[1] = y
        body.air_velocity_map[2] = z
