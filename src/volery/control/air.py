"""The air around the UAVs and its rain, computed at each guidance tick."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.vehicle.compiled import inner_kernel
from volery.vehicle.plant import AIR_DENSITY
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
    """Sets `air_velocity_map` (m/s, map) of a `UAV` record until the next tick.

    downwash: downward m/s of the air below other UAVs. air, nodes: the weather, see
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


@inner_kernel
def feel_rain(body: Any, plant: Any, air: Any, period: float) -> None:
    """Adds the push of one tick's rain to a `BODY`: drops lose their momentum on it.

    Water of density W with relative velocity u pushes an area A with W |u| u A; A is the area that
    the body's vertical drag counts (modelling choice). The velocity changes once per tick, which
    accelerometers do not measure: at 50 mm/h the force is 5 mN on an F450. Contact holds UAVs on
    the ground.
    """
    if body.on_ground:
        return
    x = body.air_velocity_map[0] - body.velocity_map[0]
    y = body.air_velocity_map[1] - body.velocity_map[1]
    z = body.air_velocity_map[2] - body.velocity_map[2] - air.rain_speed
    area = plant.drag[2] / (0.5 * AIR_DENSITY)
    gain = air.rain_water * math.sqrt(x * x + y * y + z * z) * area * plant.inverse_mass * period
    body.velocity_map[0] += gain * x
    body.velocity_map[1] += gain * y
    body.velocity_map[2] += gain * z
