"""Flies to a position at a speed set by parameters and missions.

Far away the UAV receives velocities: along the ground the largest from which it can still brake,
and likewise in height. Near the goal it receives the position itself, which its own controllers
hold.
"""

from __future__ import annotations

import math

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import mode_transitions
from volery.mavlink.autopilot.modes.setpoints import OffboardSetpoint
from volery.mavlink.autopilot.state import MissionLeg

_NEAR_M = 1.5
"""Distance below which the position itself is commanded."""
_GAIN = 0.95
"""Gain of the speed near the goal, 1/s, PX4's MPC_XY_P."""
_ARRIVED_M, _ARRIVED_M_S = 0.3, 0.5


def fly_leg(context: AutopilotContext, leg: MissionLeg) -> bool:
    """Flies on; returns whether the UAV has arrived and is at rest."""
    state = context.state
    x, y, z = (goal - here for goal, here in zip(leg.target, state.position, strict=True))
    level, away = math.hypot(x, y), math.hypot(x, y, z)
    context.memory.target = OffboardSetpoint(
        position=leg.target, yaw=math.nan if leg.yaw is None else leg.yaw
    )
    if leg.locked:
        return away < _ARRIVED_M and math.hypot(*state.velocity) < _ARRIVED_M_S
    if away < _NEAR_M:
        leg.locked = True
        mode_transitions.order(context, "go_to", context.vehicle.go_to(leg.target, leg.yaw))
        return False
    speed = min(leg.speed, approach_speed(level, float(context.parameter("MPC_ACC_HOR"))))
    direction = "UP" if z > 0.0 else "DN"
    limit = min(
        float(context.parameter(f"MPC_Z_{kind}_{direction}")) for kind in ("V_AUTO", "VEL_MAX")
    )
    climb = min(limit, approach_speed(abs(z), 0.5 * float(context.parameter("MPC_ACC_HOR"))))
    fraction = speed / level if level > 1e-6 else 0.0
    velocity = (fraction * x, fraction * y, math.copysign(climb, z))
    context.vehicle.steer(velocity, leg.yaw, 0.0)
    mode_transitions.order(context, "steer")
    return False


def bearing(context: AutopilotContext, target: tuple[float, float, float]) -> float | None:
    """Returns the yaw in the map, rad, from the UAV to a position; None if it is too close."""
    dx, dy = target[0] - context.state.position[0], target[1] - context.state.position[1]
    return math.atan2(dy, dx) if math.hypot(dx, dy) > 1.0 else None


def approach_speed(distance: float, brake: float) -> float:
    """Returns the speed, m/s, from which `brake` m/s^2 stops in time; linear near the goal."""
    linear = brake / _GAIN**2
    if distance <= linear:
        return _GAIN * distance
    return math.sqrt(2.0 * brake * (distance - 0.5 * linear))
