"""The compiled air, called from Python."""

import numpy as np

from volery.core.compiled import kernel
from volery.world.terrain import Terrain, TerrainGrid
from volery.world.weather.air import air_velocity
from volery.world.weather.dryden import new_turbulence
from volery.world.weather.table import air_of
from volery.world.weather.wind_field import nodes_of

TICK_S = 0.008
FLAT = Terrain.flat(2000.0, 0.0, (-1000.0, -1000.0))


@kernel
def _ask(air, nodes, heights, x0, y0, spacing, turbulence, position, velocity, tick, period, out):
    grid = TerrainGrid(heights, x0, y0, spacing)
    for i in range(len(out)):
        out[i, 0], out[i, 1], out[i, 2] = air_velocity(
            air[0], nodes, grid, turbulence[i], position[i], velocity[i], tick[i], period
        )


def air_at(
    weather, position, *, tick=0, velocity=(0, 0, 0), terrain=FLAT, period=TICK_S, filters=None
):
    """Velocities (N, 3) at `position` (N, 3), all arguments broadcast."""
    position = np.atleast_2d(np.asarray(position, float))
    tick = np.atleast_1d(np.asarray(tick, np.int64))
    count = max(len(position), len(tick))
    if filters is None:
        filters = new_turbulence(0, [f"uav{i}" for i in range(count)])
    out = np.empty((count, 3))
    _ask(
        air_of(weather),
        nodes_of(weather.field),
        *terrain.grid,
        filters,
        np.array(np.broadcast_to(position, (count, 3))),
        np.array(np.broadcast_to(np.asarray(velocity, float), (count, 3))),
        np.array(np.broadcast_to(tick, count)),
        period,
        out,
    )
    return out
