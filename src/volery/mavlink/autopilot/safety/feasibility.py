"""Checks whether a mission can be flown, by the rules of PX4's feasibility checker.

The rules are those of multicopters. Rules and texts follow `FeasibilityChecker.cpp` and
`mission_feasibility_checker.cpp` of PX4 1.18. As in PX4, a plan that fails is stored but cannot
start.
"""

from __future__ import annotations

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import mode_requirements
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.protocols import plans
from volery.mavlink.autopilot.protocols.item_positions import item_position
from volery.mavlink.autopilot.safety.geofence import breach


def obstacle(context: AutopilotContext) -> str:
    """Returns what prevents the start of a mission; empty if a mission can start."""
    return mode_requirements.missing(context.memory, Mode.MISSION) or problem(context)


def problem(context: AutopilotContext) -> str:
    """Returns why the stored mission cannot be flown now; empty if it can, or if there is none."""
    items = context.memory.plans[plans.MISSION]
    if items and items[0].command == plans.LAND and context.state.mode == "LANDED":
        return "Mission rejected: starts with landing"
    return _problem_of_take_off(context, items) or _problem_with_fence(context, items)


def _problem_of_take_off(context: AutopilotContext, items: list[plans.MissionItem]) -> str:
    home = context.memory.home_or_origin
    placed = False
    for item in items:
        if item.command == plans.TAKE_OFF:
            if not item_position(context, item)[2] > home[2]:
                return "Mission rejected: Takeoff altitude below home altitude!"
            if placed:
                return "Mission rejected: takeoff not first waypoint item"
        placed = placed or item.command not in plans.NEED_NO_POSITION
    return ""


def _problem_with_fence(context: AutopilotContext, items: list[plans.MissionItem]) -> str:
    for number, item in enumerate(items, 1):
        if item.command in plans.PLACED and breach(context, item_position(context, item)):
            return f"Geofence violation for waypoint {number}"
    return ""
