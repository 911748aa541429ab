"""Commands to many UAVs at once, as arrays; `control.commands` commands single UAVs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from volery.control.flight_modes import FlightMode
from volery.control.setpoints import ControlLevel
from volery.core import rotations
from volery.core.arrays import Array

_DEAF = (FlightMode.LANDED, FlightMode.TAKE_OFF, FlightMode.CRASHED)


def command_velocities(
    bodies: NDArray[np.void],
    control_states: NDArray[np.void],
    step: int,
    velocity: Array,
    yaw_rate: Array,
) -> None:
    """Sets velocity setpoints of all flying UAVs, as `FleetCommands.command_velocity_body` does.

    bodies, control_states: (N,) rows of `BODY` and `CONTROL_STATE`. velocity: (N, 3) m/s in the
    level heading frame; yaw_rate: (N,) rad/s. UAVs that are on the ground, crashed or taking off
    are skipped.
    """
    hears = ~np.isin(control_states["mode"], [int(mode) for mode in _DEAF])
    bodies["still_steps"][hears] = 0
    bodies["ground_budget"][hears] = 0.0
    bodies["downwash_budget"][hears] = 0.0
    fresh = np.flatnonzero(hears & (control_states["level"] != ControlLevel.GUIDED))
    if len(fresh):
        yaw = rotations.yaw_of(bodies["attitude"][fresh])
        heading = np.column_stack([np.cos(yaw), np.sin(yaw)])
        control_states["level"][fresh] = ControlLevel.GUIDED
        control_states["position"][fresh] = bodies["position_map"][fresh]
        control_states["velocity"][fresh] = bodies["velocity_map"][fresh]
        control_states["acceleration"][fresh] = 0.0
        control_states["velocity_integral"][fresh] = 0.0
        control_states["heading"][fresh] = control_states["heading_target"][fresh] = heading
    control_states["mode"][hears] = FlightMode.VELOCITY
    control_states["calm_ticks"][hears] = 0
    control_states["velocity_target"][hears] = velocity[hears]
    control_states["velocity_in_heading"][hears] = True
    control_states["deadline_step"][hears] = step + control_states["timeout_steps"][hears]
    control_states["turning"][hears] = True
    control_states["yaw_rate_target"][hears] = yaw_rate[hears]


def enter_low_level(
    bodies: NDArray[np.void],
    control_states: NDArray[np.void],
    step: int,
    level: ControlLevel,
    setpoints: Mapping[str, Array],
) -> None:
    """Sets low-level setpoints (N, ...) by field of all UAVs, except those that have crashed.

    The batch form of the commands of single UAVs to rotors, rates and attitudes.
    """
    chosen = control_states["mode"] != FlightMode.CRASHED
    rests = chosen & (bodies["on_ground"] | bodies["asleep"])
    bodies["last_contact_step"][rests] = step
    bodies["asleep"][chosen] = False
    bodies["still_steps"][chosen] = 0
    bodies["ground_budget"][chosen] = 0.0
    bodies["downwash_budget"][chosen] = 0.0
    control_states["mode"][chosen] = FlightMode.LOW_LEVEL
    control_states["level"][chosen] = level
    for name, values in setpoints.items():
        control_states[name][chosen] = values[chosen]
