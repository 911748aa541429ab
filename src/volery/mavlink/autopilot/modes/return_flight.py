"""Flies the return: climb, cross, descend, wait, land."""

from __future__ import annotations

import math

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import mode_transitions
from volery.mavlink.autopilot.modes.legs import bearing, fly_leg
from volery.mavlink.autopilot.protocols import plans
from volery.mavlink.autopilot.protocols.item_positions import item_position
from volery.mavlink.autopilot.state import MissionLeg, ReturnState
from volery.mavlink.autopilot.vehicle import FlightState, Vector


def fly(context: AutopilotContext, state: FlightState) -> None:
    """Continues or starts the return."""
    memory = context.memory
    if state.mode == "LANDED" or memory.order == "land":
        return
    if memory.return_state is None:
        memory.return_state = ReturnState(goal_of(context), "climb", memory.now_ns)
        _begin_leg(context, memory.return_state)
    if memory.leg is not None and not fly_leg(context, memory.leg):
        return
    progress = memory.return_state
    if progress.phase == "wait":
        delay_s = float(context.parameter("RTL_LAND_DELAY"))
        if 0.0 <= delay_s <= (memory.now_ns - progress.since_ns) * 1e-9:
            memory.leg = None
            mode_transitions.order(context, "land", context.vehicle.land())
        return
    following = {"climb": "cross", "cross": "descend", "descend": "wait"}[progress.phase]
    memory.return_state = ReturnState(progress.goal, following, memory.now_ns)
    if following != "wait":
        _begin_leg(context, memory.return_state)


def goal_of(context: AutopilotContext) -> Vector:
    """Returns home or the nearest rally point, whichever is nearer."""
    memory = context.memory
    home = memory.home_or_origin
    points = [home, *(item_position(context, item) for item in memory.plans[plans.RALLY])]
    return min(points, key=lambda point: math.dist(point[:2], context.state.position[:2]))


def _begin_leg(context: AutopilotContext, progress: ReturnState) -> None:
    memory = context.memory
    x, y, z = context.state.position
    goal, home = progress.goal, memory.home_or_origin
    if progress.phase == "climb":
        far = math.dist(goal[:2], (x, y)) > float(context.parameter("RTL_MIN_DIST"))
        top = max(z, home[2] + float(context.parameter("RTL_RETURN_ALT"))) if far else z
        memory.leg = MissionLeg((x, y, top), None, mode_transitions.cruise(context))
    elif progress.phase == "cross":
        target = (goal[0], goal[1], z if memory.leg is None else memory.leg.target[2])
        memory.leg = MissionLeg(target, bearing(context, target), mode_transitions.cruise(context))
    else:
        low = min(z, max(goal[2], home[2]) + float(context.parameter("RTL_DESCEND_ALT")))
        chosen = memory.home_yaw if goal == home else math.nan
        yaw = chosen if math.isfinite(chosen) else None
        memory.leg = MissionLeg((goal[0], goal[1], low), yaw, mode_transitions.cruise(context))
