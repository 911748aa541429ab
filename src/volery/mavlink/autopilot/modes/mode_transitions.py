"""Changes of mode: requirements, first commands, and other clients' control of the UAV.

Other clients of the graph may command the UAV too. The autopilot then reports the most similar mode
and sends no commands until a mode is requested.
"""

from __future__ import annotations

import math

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import mode_requirements
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.safety import arming, feasibility
from volery.mavlink.autopilot.state import MissionLeg
from volery.mavlink.autopilot.vehicle import FlightState, Vector

_FOLLOWS = {
    "take_off": {"TAKE_OFF", "HOLD", "LANDED"},
    "hold": {"HOLD"},
    "land": {"LAND", "LANDED"},
    "go_to": {"GO_TO", "HOLD"},
    "steer": {"VELOCITY", "HOLD"},
    "follow": {"TRAJECTORY", "HOLD"},
    "push": {"LOW_LEVEL"},
    "tilt": {"LOW_LEVEL"},
    "spin": {"LOW_LEVEL"},
    "stop": {"LOW_LEVEL", "LANDED"},
    "": {"LANDED"},
}
"""Modes of the UAV that follow from a command."""
_EXTERNAL_MODES = {"TAKE_OFF": Mode.TAKE_OFF, "LAND": Mode.LAND, "RETURN": Mode.RETURN}
"""Mode reported while another client controls the UAV; else: hold."""
_COMMAND_TIMEOUT_NS = 50_000_000
"""Time that a command may take to show in the UAV's mode."""


def flies(context: AutopilotContext) -> bool:
    """Returns whether the UAV is off the ground, under any control."""
    return context.state.mode not in ("LANDED", "CRASHED")


def cruise(context: AutopilotContext) -> float:
    """Returns the cruise speed, m/s: of the mission, of a command, or of MPC_XY_CRUISE."""
    memory = context.memory
    requested = (memory.mission.speed if memory.mode is Mode.MISSION else math.nan, memory.cruise)
    speed = next(
        (s for s in requested if math.isfinite(s)), float(context.parameter("MPC_XY_CRUISE"))
    )
    return min(speed, float(context.parameter("MPC_XY_VEL_MAX")))


def go_to(context: AutopilotContext, position: Vector, yaw: float | None) -> None:
    """Flies to a position at cruise speed."""
    context.memory.leg = MissionLeg(position, yaw, cruise(context))


def obstacle_to(context: AutopilotContext, mode: Mode) -> str:
    """Returns why a mode cannot be entered now; empty if it can."""
    memory = context.memory
    if context.state.crashed:
        return "the vehicle has crashed"
    if memory.fix_lost and mode not in (Mode.ALTITUDE, Mode.LAND):
        return "no valid position"
    if mode is Mode.MISSION:
        return feasibility.obstacle(context)
    return mode_requirements.missing(context.memory, mode)


def request_mode(context: AutopilotContext, mode: Mode) -> str:
    """Enters a requested mode; returns why not, empty if entered.

    A disarmed UAV may enter any mode: missing requirements prevent arming, as in PX4.
    """
    why = obstacle_to(context, mode) if context.memory.armed else ""
    if not why:
        context.memory.failsafe = False
        enter(context, mode)
    return why


def enter(context: AutopilotContext, mode: Mode) -> None:
    """Enters a mode."""
    memory = context.memory
    changed = memory.mode is not mode
    memory.mode = mode
    memory.leg = memory.return_state = memory.target = None
    memory.altitude_target = math.nan
    if mode is not Mode.FOLLOW_TARGET:
        memory.followed = None
    if mode is not Mode.MISSION:
        memory.mission.entered = memory.mission.stays = False
    if memory.armed and flies(context):
        if mode is Mode.LAND:
            order(context, "land", context.vehicle.land())
        elif mode is Mode.TAKE_OFF:
            rise(context)
        elif mode is Mode.OFFBOARD:
            # It continues its motion until the next setpoint; a take-off first reaches the height
            # at which setpoints are flown.
            order(context, "take_off" if context.state.mode == "TAKE_OFF" else "steer")
        else:
            order(context, "hold", context.vehicle.hold())
    if changed:
        context.announce()


def rise(context: AutopilotContext) -> None:
    """Takes off from the ground, or climbs by the same height in the air."""
    height = context.memory.take_off_height
    if not math.isfinite(height):
        height = float(context.parameter("MIS_TAKEOFF_ALT"))
    memory = context.memory
    x, y, z = context.state.position
    if memory.take_off_position is not None:
        x, y = memory.take_off_position
    requested = math.isfinite(memory.take_off_height)
    memory.take_off_height, memory.take_off_position = math.nan, None
    if not flies(context):
        height = max(height, 0.1)
        memory.take_off_goal = x, y, z + height
        order(context, "take_off", context.vehicle.take_off(height))
        return
    ground = memory.home_or_origin[2]
    go_to(context, (x, y, z + height if requested else max(z, ground + height)), None)


def order(context: AutopilotContext, what: str, why_not: str = "") -> None:
    """Records a command to the UAV, and reports why the UAV refused it."""
    context.memory.order, context.memory.sinks = what, math.nan
    context.memory.ordered_ns = context.memory.now_ns
    if why_not:
        context.memory.order = ""
        context.report(4, why_not)


def follow_vehicle(context: AutopilotContext, state: FlightState) -> None:
    """Detects take-offs, landings, crashes, and other clients' control of the UAV."""
    memory = context.memory
    if state.crashed:
        if memory.armed:
            context.report(0, "Crash detected: motors stopped")
            arming.finish(context, "Disarmed")
        return
    settled = memory.now_ns - memory.ordered_ns > _COMMAND_TIMEOUT_NS
    if settled and state.mode not in _FOLLOWS.get(memory.order, {memory.order}):
        _step_back(context, state)
    if state.airborne and not memory.airborne and memory.armed:
        memory.airborne = True
        context.report(6, "Takeoff detected")
    if state.mode == "LANDED" and memory.airborne:
        memory.airborne, memory.landed_ns = False, memory.now_ns
        context.report(6, "Landing detected")
        memory.order, memory.leg = "", None
    if memory.armed and state.mode == "LANDED" and not _begins(context):
        _disarm_in_time(context)


def _step_back(context: AutopilotContext, state: FlightState) -> None:
    """Reports that another client controls the UAV, and stops sending commands."""
    memory = context.memory
    memory.order = state.mode if state.mode != "LANDED" else ""
    memory.leg = memory.return_state = None
    if state.mode == "LANDED":
        return
    if not memory.armed:
        memory.armed, memory.armed_ns = True, memory.now_ns
        memory.home = memory.home or state.position
    mode = _EXTERNAL_MODES.get(state.mode, Mode.HOLD)
    if mode is not memory.mode:
        memory.mode = mode
    context.announce()


def _begins(context: AutopilotContext) -> bool:
    """Returns whether a take-off has started that has not left the ground."""
    return (
        context.memory.order == "take_off"
        and context.memory.now_ns - context.memory.ordered_ns < 1e9
    )


def _disarm_in_time(context: AutopilotContext) -> None:
    memory = context.memory
    flown = memory.landed_ns > memory.armed_ns
    name = "COM_DISARM_LAND" if flown else "COM_DISARM_PRFLT"
    limit_s = float(context.parameter(name))
    since_ns = memory.landed_ns if flown else memory.armed_ns
    if limit_s > 0.0 and memory.now_ns - since_ns >= limit_s * 1e9:
        arming.finish(context, f"Disarmed by {'landing' if flown else 'auto preflight disarming'}")
