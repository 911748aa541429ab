"""Checks whether a mission can be flown, by the rules of PX4's feasibility checker.

The rules are those of multicopters. Rules and texts follow `FeasibilityChecker.cpp` and
`mission_feasibility_checker.cpp` of PX4 1.18. As in PX4, a plan that fails is stored but cannot
start.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from volery.mavlink.autopilot import mode_requirements, plans
from volery.mavlink.autopilot.geofence import breach
from volery.mavlink.autopilot.modes import Mode

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot
    from volery.mavlink.autopilot.vehicle import Vector


def obstacle(autopilot: Autopilot) -> str:
    """Returns what prevents the start of a mission; empty if a mission can start."""
    return mode_requirements.missing(autopilot, Mode.MISSION) or problem(autopilot)


def problem(autopilot: Autopilot) -> str:
    """Returns why the stored mission cannot be flown now; empty if it can, or if there is none."""
    items = autopilot.memory.plans[plans.MISSION]
    if items and items[0].command == plans.LAND and autopilot.state.mode == "LANDED":
        return "Mission rejected: starts with landing"
    return _problem_of_take_off(autopilot, items) or _problem_with_fence(autopilot, items)


def look(autopilot: Autopilot) -> None:
    """Checks a new mission or fence: reports a problem, and holds if the mission was active."""
    from volery.mavlink.autopilot import mode_transitions

    if autopilot.memory.state is None:
        return
    why = problem(autopilot)
    if not why:
        _warn_of_far_start(autopilot)
        return
    autopilot.say(2, why)
    if autopilot.memory.mode is Mode.MISSION and autopilot.memory.armed:
        mode_transitions.enter(autopilot, Mode.HOLD)


def _problem_of_take_off(autopilot: Autopilot, items: list[plans.MissionItem]) -> str:
    home = _home(autopilot)
    placed = False
    for item in items:
        if item.command == plans.TAKE_OFF:
            if not _place_of(autopilot, item)[2] > home[2]:
                return "Mission rejected: Takeoff altitude below home altitude!"
            if placed:
                return "Mission rejected: takeoff not first waypoint item"
        placed = placed or item.command not in plans.NEED_NO_PLACE
    return ""


def _problem_with_fence(autopilot: Autopilot, items: list[plans.MissionItem]) -> str:
    for number, item in enumerate(items, 1):
        if item.command in plans.PLACED and breach(autopilot, _place_of(autopilot, item)):
            return f"Geofence violation for waypoint {number}"
    return ""


def _warn_of_far_start(autopilot: Autopilot) -> None:
    """Warns of a first waypoint beyond MIS_DIST_1WP, which may still be flown."""
    limit = float(autopilot.parameter("MIS_DIST_1WP"))
    items = autopilot.memory.plans[plans.MISSION]
    first = next((item for item in items if item.command in plans.PLACED and item.placed), None)
    if first is None or limit <= 0.0:
        return
    away = math.dist(_place_of(autopilot, first)[:2], _home(autopilot)[:2])
    if away >= limit:
        autopilot.say(2, f"First waypoint far away from home: {away:.0f}m. Correct mission loaded?")


def _home(autopilot: Autopilot) -> Vector:
    return autopilot.memory.home or autopilot.memory.origin


def _place_of(autopilot: Autopilot, item: plans.MissionItem) -> Vector:
    from volery.mavlink.autopilot.mission_flight import place_of

    return place_of(autopilot, item)
