"""Runs the active flight mode at each state of the UAV; take-off, hold and landing are here."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import (
    follow_target,
    manual_control,
    mission_flight,
    mode_transitions,
    offboard,
    orbit,
    return_flight,
)
from volery.mavlink.autopilot.modes.legs import fly_leg
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.modes.setpoints import OffboardSetpoint
from volery.mavlink.autopilot.state import MissionLeg
from volery.mavlink.autopilot.vehicle import FlightState

_ASIDE_M = 1.0
"""Distance from which a take-off ends at a position of its own (modelling choice)."""
_DESCENT_STEP_M_S = 0.02
"""Smallest change of a landing's speed that is sent as a command."""


def fly(context: AutopilotContext, state: FlightState) -> None:
    """Runs the current mode, except while disarmed or while another client controls the UAV."""
    memory = context.memory
    if not memory.armed or state.crashed or memory.order.isupper():
        return
    _FLIGHTS[memory.mode](context, state)
    if memory.order == "land" and state.mode == "LAND":
        _set_descent_speed(context, state)


def _take_off(context: AutopilotContext, state: FlightState) -> None:
    memory = context.memory
    if state.mode == "LANDED":
        if memory.order != "take_off":
            mode_transitions.rise(context)
        return
    there = state.mode == "HOLD" if memory.leg is None else fly_leg(context, memory.leg)
    goal = memory.take_off_goal
    aside = goal is not None and math.dist(goal[:2], state.position[:2]) > _ASIDE_M
    if there and memory.leg is None and goal is not None and aside:
        mode_transitions.go_to(context, goal, None)  # it climbs before it goes there
        return
    if there:
        wants_mission = context.parameter("COM_TAKEOFF_ACT") == 1
        goes_on = wants_mission and not mode_transitions.obstacle_to(context, Mode.MISSION)
        leg = memory.leg
        if leg is None and memory.take_off_goal is not None:
            leg = MissionLeg(memory.take_off_goal, None, mode_transitions.cruise(context))
        mode_transitions.enter(context, Mode.MISSION if goes_on else Mode.HOLD)
        memory.leg = None if goes_on else leg


def _hold(context: AutopilotContext, state: FlightState) -> None:
    if context.memory.leg is not None and state.mode != "LANDED":
        fly_leg(context, context.memory.leg)


def _land(context: AutopilotContext, state: FlightState) -> None:
    if state.mode not in ("LANDED", "LAND") and context.memory.order != "land":
        mode_transitions.order(context, "land", context.vehicle.land())
    if context.memory.target is None:
        x, y, _ = state.position
        context.memory.target = OffboardSetpoint(position=(x, y, math.nan))


def _set_descent_speed(context: AutopilotContext, state: FlightState) -> None:
    """Sets the current landing's descent speed by its height."""
    memory = context.memory
    ground = memory.home_or_origin[2]
    speed = _descent_speed_at(context, state.position[2] - ground)
    if not abs(speed - memory.sinks) < _DESCENT_STEP_M_S:
        memory.sinks = speed
        context.vehicle.sink(speed)


def _descent_speed_at(context: AutopilotContext, height_m: float) -> float:
    """Returns the descent speed, m/s, at a height: fast high up, slow near the ground.

    Follows PX4's FlightTaskAuto: MPC_Z_VEL_MAX_DN above MPC_LAND_ALT1, MPC_LAND_SPEED below
    MPC_LAND_ALT2, interpolated by height in between, and MPC_Z_V_AUTO_DN at most. The height is
    that above home, as in a PX4 without a distance sensor.
    """
    slow, fast, max_speed = (
        float(context.parameter(name))
        for name in ("MPC_LAND_SPEED", "MPC_Z_VEL_MAX_DN", "MPC_Z_V_AUTO_DN")
    )
    low = float(context.parameter("MPC_LAND_ALT2"))
    high = max(float(context.parameter("MPC_LAND_ALT1")), low)
    return min(float(np.interp(height_m, (low, high), (slow, fast))), max_speed)


_FLIGHTS: dict[Mode, Callable[[AutopilotContext, FlightState], None]] = {
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
