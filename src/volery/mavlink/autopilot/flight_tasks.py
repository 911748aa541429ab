"""Runs the active flight mode at each state of the UAV."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from volery.mavlink.autopilot import (
    follow_target,
    landing,
    manual_control,
    mission_flight,
    mode_transitions,
    offboard,
    orbit,
    return_flight,
)
from volery.mavlink.autopilot.legs import fly_leg
from volery.mavlink.autopilot.modes import Mode
from volery.mavlink.autopilot.setpoints import OffboardSetpoint
from volery.mavlink.autopilot.state import MissionLeg

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot
    from volery.mavlink.autopilot.vehicle import FlightState


def fly(autopilot: Autopilot, state: FlightState) -> None:
    """Runs the current mode, except while disarmed or while another client controls the UAV."""
    memory = autopilot.memory
    if not memory.armed or state.crashed or memory.order.isupper():
        return
    _FLIGHTS[memory.mode](autopilot, state)
    if memory.order == "land" and state.mode == "LAND":
        landing.follow(autopilot, state)


def _take_off(autopilot: Autopilot, state: FlightState) -> None:
    memory = autopilot.memory
    if state.mode == "LANDED":
        if memory.order != "take_off":
            mode_transitions.rise(autopilot)
        return
    there = state.mode == "HOLD" if memory.leg is None else fly_leg(autopilot, memory.leg)
    if there:
        wants_mission = autopilot.parameter("COM_TAKEOFF_ACT") == 1
        goes_on = wants_mission and not mode_transitions.obstacle_to(autopilot, Mode.MISSION)
        leg = memory.leg
        if leg is None and memory.take_off_goal is not None:
            leg = MissionLeg(memory.take_off_goal, None, mode_transitions.cruise(autopilot))
        mode_transitions.enter(autopilot, Mode.MISSION if goes_on else Mode.HOLD)
        memory.leg = None if goes_on else leg


def _hold(autopilot: Autopilot, state: FlightState) -> None:
    if autopilot.memory.leg is not None and state.mode != "LANDED":
        fly_leg(autopilot, autopilot.memory.leg)


def _land(autopilot: Autopilot, state: FlightState) -> None:
    if state.mode not in ("LANDED", "LAND") and autopilot.memory.order != "land":
        mode_transitions.order(autopilot, "land", autopilot.vehicle.land())
    if autopilot.memory.target is None:
        x, y, _ = state.position
        autopilot.memory.target = OffboardSetpoint(position=(x, y, math.nan))


_FLIGHTS: dict[Mode, Callable[[Autopilot, FlightState], None]] = {
    Mode.ALTITUDE: manual_control.fly_altitude,
    Mode.POSITION: manual_control.fly_position,
    Mode.ORBIT: orbit.fly,
    Mode.TAKE_OFF: _take_off,
    Mode.HOLD: _hold,
    Mode.MISSION: mission_flight.fly,
    Mode.RETURN: return_flight.fly,
    Mode.LAND: _land,
    Mode.FOLLOW_TARGET: follow_target.fly,
    Mode.OFFBOARD: offboard.fly,
}
