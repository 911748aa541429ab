"""Flies the return: climb, cross, descend, wait, land."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from volery.mavlink.autopilot import mode_transitions, plans
from volery.mavlink.autopilot.legs import bearing, fly_leg
from volery.mavlink.autopilot.mission_flight import place_of
from volery.mavlink.autopilot.state import MissionLeg, ReturnState

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot
    from volery.mavlink.autopilot.vehicle import FlightState, Vector


def fly(autopilot: Autopilot, state: FlightState) -> None:
    """Continues or starts the return."""
    memory = autopilot.memory
    if state.mode == "LANDED" or memory.order == "land":
        return
    if memory.way_home is None:
        memory.way_home = ReturnState(goal_of(autopilot), "climb", memory.now_ns)
        _begin_leg(autopilot, memory.way_home)
    if memory.leg is not None and not fly_leg(autopilot, memory.leg):
        return
    way = memory.way_home
    if way.phase == "wait":
        delay_s = float(autopilot.parameter("RTL_LAND_DELAY"))
        if 0.0 <= delay_s <= (memory.now_ns - way.since_ns) * 1e-9:
            memory.leg = None
            mode_transitions.order(autopilot, "land", autopilot.vehicle.land())
        return
    following = {"climb": "cross", "cross": "descend", "descend": "wait"}[way.phase]
    memory.way_home = ReturnState(way.goal, following, memory.now_ns)
    if following != "wait":
        _begin_leg(autopilot, memory.way_home)


def goal_of(autopilot: Autopilot) -> Vector:
    """Returns home or the nearest rally point, whichever is nearer."""
    memory = autopilot.memory
    home = memory.home or memory.origin
    points = [home, *(place_of(autopilot, item) for item in memory.plans[plans.RALLY])]
    return min(points, key=lambda point: math.dist(point[:2], autopilot.state.position[:2]))


def _begin_leg(autopilot: Autopilot, way: ReturnState) -> None:
    memory = autopilot.memory
    x, y, z = autopilot.state.position
    goal, home = way.goal, memory.home or memory.origin
    if way.phase == "climb":
        far = math.dist(goal[:2], (x, y)) > float(autopilot.parameter("RTL_MIN_DIST"))
        top = max(z, home[2] + float(autopilot.parameter("RTL_RETURN_ALT"))) if far else z
        memory.leg = MissionLeg((x, y, top), None, mode_transitions.cruise(autopilot))
    elif way.phase == "cross":
        target = (goal[0], goal[1], z if memory.leg is None else memory.leg.target[2])
        memory.leg = MissionLeg(
            target, bearing(autopilot, target), mode_transitions.cruise(autopilot)
        )
    else:
        low = min(z, max(goal[2], home[2]) + float(autopilot.parameter("RTL_DESCEND_ALT")))
        memory.leg = MissionLeg((goal[0], goal[1], low), None, mode_transitions.cruise(autopilot))
