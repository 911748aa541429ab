"""Whether a mission can be flown, by the rules of PX4's feasibility checker for multicopters.

Which rules, and what is said: `FeasibilityChecker.cpp` and `mission_feasibility_checker.cpp` of PX4
1.18. A plan that fails is kept, as PX4 keeps it, and is not begun.
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


def obstacle(pilot: Autopilot) -> str:
    """What keeps a mission from being begun; empty where one is there that can be flown."""
    return mode_requirements.missing(pilot, Mode.MISSION) or trouble(pilot)


def trouble(pilot: Autopilot) -> str:
    """Why the mission on board cannot be flown now; empty where it can, or where there is none."""
    items = pilot.memory.plans[plans.MISSION]
    if items and items[0].command == plans.LAND and pilot.state.mode == "LANDED":
        return "Mission rejected: starts with landing"
    return _trouble_of_take_off(pilot, items) or _trouble_with_fence(pilot, items)


def look(pilot: Autopilot) -> None:
    """Look at a new mission or fence: tell what is wrong, and hold where it was being flown."""
    from volery.mavlink.autopilot import mode_transitions

    if pilot.memory.state is None:
        return
    why = trouble(pilot)
    if not why:
        _warn_of_far_start(pilot)
        return
    pilot.say(2, why)
    if pilot.memory.mode is Mode.MISSION and pilot.memory.armed:
        mode_transitions.enter(pilot, Mode.HOLD)


def _trouble_of_take_off(pilot: Autopilot, items: list[plans.MissionItem]) -> str:
    home = _home(pilot)
    placed = False
    for item in items:
        if item.command == plans.TAKE_OFF:
            if not _place_of(pilot, item)[2] > home[2]:
                return "Mission rejected: Takeoff altitude below home altitude!"
            if placed:
                return "Mission rejected: takeoff not first waypoint item"
        placed = placed or item.command not in plans.NEED_NO_PLACE
    return ""


def _trouble_with_fence(pilot: Autopilot, items: list[plans.MissionItem]) -> str:
    for number, item in enumerate(items, 1):
        if item.command in plans.PLACED and breach(pilot, _place_of(pilot, item)):
            return f"Geofence violation for waypoint {number}"
    return ""


def _warn_of_far_start(pilot: Autopilot) -> None:
    """Of a first waypoint beyond MIS_DIST_1WP, which may still be flown."""
    limit = float(pilot.parameter("MIS_DIST_1WP"))
    items = pilot.memory.plans[plans.MISSION]
    first = next((item for item in items if item.command in plans.PLACED and item.placed), None)
    if first is None or limit <= 0.0:
        return
    away = math.dist(_place_of(pilot, first)[:2], _home(pilot)[:2])
    if away >= limit:
        pilot.say(2, f"First waypoint far away from home: {away:.0f}m. Correct mission loaded?")


def _home(pilot: Autopilot) -> Vector:
    return pilot.memory.home or pilot.memory.origin


def _place_of(pilot: Autopilot, item: plans.MissionItem) -> Vector:
    from volery.mavlink.autopilot.mission_flight import place_of

    return place_of(pilot, item)
