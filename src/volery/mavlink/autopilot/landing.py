"""How fast a landing goes down: fast high up, slowly near the ground.

As PX4's FlightTaskAuto does it: MPC_Z_VEL_MAX_DN from MPC_LAND_ALT1 upwards, MPC_LAND_SPEED from
MPC_LAND_ALT2 downwards, in between by the height, and MPC_Z_V_AUTO_DN at most. Height is that above
home, as of a PX4 without a distance sensor.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot
    from volery.mavlink.autopilot.vehicle import FlightState

_STEP_M_S = 0.02
"""Smaller changes are not worth a command."""


def follow(autopilot: Autopilot, state: FlightState) -> None:
    """Have the present landing sink as the height asks for."""
    memory = autopilot.memory
    ground = (memory.home or memory.origin)[2]
    speed = speed_at(autopilot, state.position[2] - ground)
    if not abs(speed - memory.sinks) < _STEP_M_S:
        memory.sinks = speed
        autopilot.vehicle.sink(speed)


def speed_at(autopilot: Autopilot, height_m: float) -> float:
    """m/s at a height above ground."""
    slow, fast, most = (
        float(autopilot.parameter(name))
        for name in ("MPC_LAND_SPEED", "MPC_Z_VEL_MAX_DN", "MPC_Z_V_AUTO_DN")
    )
    low = float(autopilot.parameter("MPC_LAND_ALT2"))
    high = max(float(autopilot.parameter("MPC_LAND_ALT1")), low)
    return min(float(np.interp(height_m, (low, high), (slow, fast))), most)
