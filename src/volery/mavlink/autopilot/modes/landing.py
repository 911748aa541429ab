"""Sets the descent speed of a landing: fast high up, slow near the ground.

Follows PX4's FlightTaskAuto: MPC_Z_VEL_MAX_DN above MPC_LAND_ALT1, MPC_LAND_SPEED below
MPC_LAND_ALT2, interpolated by height in between, and MPC_Z_V_AUTO_DN at most. The height is that
above home, as in a PX4 without a distance sensor.
"""

from __future__ import annotations

import numpy as np

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.vehicle import FlightState

_STEP_M_S = 0.02
"""Smallest change that is sent as a command."""


def follow(context: AutopilotContext, state: FlightState) -> None:
    """Sets the current landing's descent speed by its height."""
    memory = context.memory
    ground = memory.home_or_origin[2]
    speed = speed_at(context, state.position[2] - ground)
    if not abs(speed - memory.sinks) < _STEP_M_S:
        memory.sinks = speed
        context.vehicle.sink(speed)


def speed_at(context: AutopilotContext, height_m: float) -> float:
    """Returns the descent speed, m/s, at a height above ground."""
    slow, fast, max_speed = (
        float(context.parameter(name))
        for name in ("MPC_LAND_SPEED", "MPC_Z_VEL_MAX_DN", "MPC_Z_V_AUTO_DN")
    )
    low = float(context.parameter("MPC_LAND_ALT2"))
    high = max(float(context.parameter("MPC_LAND_ALT1")), low)
    return min(float(np.interp(height_m, (low, high), (slow, fast))), max_speed)
