"""Commands to many UAVs at once, as arrays: what `control.commands` does one by one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.control.flight_modes import FlightMode
from volery.control.setpoints import ControlLevel
from volery.core import rotations

Array = NDArray[np.float64]

_DEAF = (FlightMode.LANDED, FlightMode.TAKE_OFF, FlightMode.CRASHED)


def command_velocities(
    bodies: NDArray[np.void], pilots: NDArray[np.void], step: int, velocity: Array, yaw_rate: Array
) -> None:
    """Let all that fly follow `velocity` (N, 3) m/s in the level heading frame and `yaw_rate` (N,).

    bodies, pilots: (N,) rows of `BODY` and `PILOT`. As `FleetCommands.command_velocity_body`, but
    UAVs on the ground, wrecks and those that take off are passed over.
    """
    hears = ~np.isin(pilots["mode"], [int(mode) for mode in _DEAF])
    bodies["still_steps"][hears] = 0
    bodies["ground_budget"][hears] = 0.0
    bodies["downwash_budget"][hears] = 0.0
    fresh = np.flatnonzero(hears & (pilots["level"] != ControlLevel.GUIDED))
    if len(fresh):
        yaw = rotations.yaw_of(bodies["attitude"][fresh])
        heading = np.column_stack([np.cos(yaw), np.sin(yaw)])
        pilots["level"][fresh] = ControlLevel.GUIDED
        pilots["position"][fresh] = bodies["position_map"][fresh]
        pilots["velocity"][fresh] = bodies["velocity_map"][fresh]
        pilots["acceleration"][fresh] = 0.0
        pilots["velocity_integral"][fresh] = 0.0
        pilots["heading"][fresh] = pilots["heading_target"][fresh] = heading
    pilots["mode"][hears] = FlightMode.VELOCITY
    pilots["calm_ticks"][hears] = 0
    pilots["velocity_target"][hears] = velocity[hears]
    pilots["velocity_in_heading"][hears] = True
    pilots["deadline_step"][hears] = step + pilots["timeout_steps"][hears]
    pilots["turning"][hears] = True
    pilots["yaw_rate_target"][hears] = yaw_rate[hears]
