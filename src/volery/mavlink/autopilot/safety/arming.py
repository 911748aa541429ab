"""Arming and disarming: checks before the rotors may turn, and when they stop.

The rotors of an armed UAV stand still until take-off: the flight modes have no idling.
"""

from __future__ import annotations

import math

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import mode_requirements
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.safety import feasibility, home


def problems(context: AutopilotContext) -> list[str]:
    """Returns the problems that prevent arming; an empty list if there are none."""
    memory = context.memory
    state = memory.state
    if state is None:
        return ["nothing is known of the vehicle"]
    found = []
    if state.crashed:
        found.append("the vehicle has crashed")
    if memory.mode in (Mode.RETURN, Mode.LAND) and not memory.armed:
        found.append("mode not suitable for arming")
    if memory.fix_lost and not context.parameter("COM_ARM_WO_GPS"):
        found.append("no satellite fix")
    if math.isfinite(state.charge) and state.charge < float(context.parameter("BAT_LOW_THR")):
        found.append("low battery")
    tilt = 1.0 - 2.0 * (state.attitude[0] ** 2 + state.attitude[1] ** 2)
    if not state.airborne and tilt < 0.7:  # PX4 refuses beyond about 45 deg
        found.append("the vehicle lies on its side")
    lacks = mode_requirements.missing(memory, memory.mode)
    found += [lacks] if lacks else []
    if int(context.parameter("NAV_DLL_ACT")) and not mode_requirements.ground_is_there(memory):
        found.append("no connection to the ground control station")
    return found


def obstacle(context: AutopilotContext) -> str:
    """Returns the first problem, including those of the mission to start; empty: none."""
    found = problems(context)
    if not found and context.memory.mode is Mode.MISSION:
        return feasibility.problem(context)
    return found[0] if found else ""


def arm(context: AutopilotContext) -> str:
    """Arms the UAV; returns why not, empty if armed.

    Arming cannot be forced: PX4 checks all requests.
    """
    memory = context.memory
    if memory.armed:
        return ""
    why = obstacle(context)
    if why:
        return why
    memory.armed, memory.armed_ns = True, memory.now_ns
    memory.airborne, memory.failsafe = False, False
    memory.warned.clear()
    home.set_on_arming(context)
    context.report(6, "Armed by external command")
    context.announce()
    return ""


def disarm(context: AutopilotContext, *, forced: bool) -> str:
    """Disarms the UAV; returns why not, empty if disarmed.

    In the air only if `forced`, and then the UAV falls.
    """
    state = context.state
    landed = state.mode in ("LANDED", "CRASHED")
    if not landed:
        if not forced:
            return "not landed"
        why = context.vehicle.stop()
        if why:
            return why
    finish(context, "Disarmed by external command")
    context.memory.order = "" if landed else "stop"
    context.memory.ordered_ns = context.memory.now_ns
    return ""


def finish(context: AutopilotContext, text: str) -> None:
    """Sets the state to disarmed and reports `text`."""
    memory = context.memory
    if not memory.armed:
        return
    memory.armed, memory.airborne, memory.failsafe = False, False, False
    memory.leg = memory.return_state = memory.target = None
    if memory.mode in (Mode.RETURN, Mode.LAND, Mode.TAKE_OFF, Mode.OFFBOARD):
        memory.mode = Mode.HOLD
    context.report(6, text)
    context.announce()
