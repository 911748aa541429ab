"""Failsafes: monitor the UAV and change the mode on problems, on simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import mode_requirements, mode_transitions
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.safety import arming
from volery.mavlink.autopilot.safety.geofence import breach
from volery.mavlink.autopilot.vehicle import FlightState

PERIOD_NS = 100_000_000
"""Time between two checks (modelling choice)."""
_FIX_TIMEOUT_NS = 5_000_000_000
"""Time without a fix after which the estimate is invalid, PX4's EKF2_NOAID_TOUT."""


def check(context: AutopilotContext, state: FlightState) -> None:
    """Checks for problems; reports each problem once and acts on it once."""
    memory = context.memory
    memory.fix_lost = memory.now_ns - memory.fix_ns > _FIX_TIMEOUT_NS
    flies = memory.armed and mode_transitions.flies(context)
    for name, look in _LOOKS.items():
        found = look(context, state) if flies or name.startswith("battery") else None
        if found is None:
            memory.warned.discard(name)
        elif name not in memory.warned:
            memory.warned.add(name)
            text, mode = found
            context.report(2 if mode else 4, text)
            if flies:
                act(context, mode)


def act(context: AutopilotContext, mode: Mode | None) -> None:
    """Enters the mode of a failsafe; landings continue.

    A UAV without a position lands at once.
    """
    memory = context.memory
    if mode is None:
        return
    if memory.fix_lost:
        mode = Mode.LAND
    if memory.mode is Mode.LAND or (memory.mode is Mode.RETURN and mode is Mode.HOLD):
        return
    memory.failsafe = True
    if mode is not memory.mode or (mode is Mode.HOLD and _flies_to_position(context)):
        mode_transitions.enter(context, mode)


def _flies_to_position(context: AutopilotContext) -> bool:
    """Returns whether a UAV in hold flies to a position.

    The cause is a reposition or another client's command.
    """
    return context.memory.leg is not None or context.memory.order not in ("hold", "HOLD")


def _position(context: AutopilotContext, _state: FlightState) -> tuple[str, Mode | None] | None:
    if not context.memory.fix_lost or context.memory.mode is Mode.ALTITUDE:
        return None
    return "Failsafe: position lost, landing", Mode.LAND


def _battery(
    level: str,
) -> Callable[[AutopilotContext, FlightState], tuple[str, Mode | None] | None]:
    def look(context: AutopilotContext, state: FlightState) -> tuple[str, Mode | None] | None:
        threshold = float(context.parameter(f"BAT_{level}_THR"))
        if not (math.isfinite(state.charge) and state.charge < threshold):
            return None
        action = int(context.parameter("COM_LOW_BAT_ACT"))
        mode = None
        if level == "CRIT":
            mode = {2: Mode.LAND, 3: Mode.RETURN}.get(action)
        elif level == "EMERGEN":
            mode = {2: Mode.LAND, 3: Mode.LAND}.get(action)
        word = {"LOW": "Low", "CRIT": "Critical", "EMERGEN": "Emergency"}[level]
        return f"{word} battery level", mode

    return look


def _fence(context: AutopilotContext, state: FlightState) -> tuple[str, Mode | None] | None:
    action = int(context.parameter("GF_ACTION"))
    broken = breach(context, state.position) if action else ""
    if not broken:
        return None
    if action == 4:
        arming.disarm(context, forced=True)
    mode = {2: Mode.HOLD, 3: Mode.RETURN, 5: Mode.LAND}.get(action)
    return f"Geofence violation: {broken}", mode


def _link(context: AutopilotContext, _state: FlightState) -> tuple[str, Mode | None] | None:
    """Checks the ground link.

    As in PX4, a link never seen counts as lost, and landings continue.
    """
    action = int(context.parameter("NAV_DLL_ACT"))
    if not action or mode_requirements.ground_is_there(context.memory):
        return None
    if context.memory.mode is Mode.LAND and "link" not in context.memory.warned:
        return None
    mode = {1: Mode.HOLD, 2: Mode.RETURN, 3: Mode.LAND}[action]
    return "Failsafe: connection to ground station lost", mode


def _sticks(context: AutopilotContext, _state: FlightState) -> tuple[str, Mode | None] | None:
    if not context.memory.mode.by_sticks or mode_requirements.sticks_are_there(context.memory):
        return None
    mode = {1: Mode.HOLD, 3: Mode.LAND}.get(int(context.parameter("NAV_RCL_ACT")), Mode.RETURN)
    return "Failsafe: manual control lost", mode


_LOOKS: dict[str, Callable[[AutopilotContext, FlightState], tuple[str, Mode | None] | None]] = {
    "position": _position,
    "battery low": _battery("LOW"),
    "battery critical": _battery("CRIT"),
    "battery emergency": _battery("EMERGEN"),
    "fence": _fence,
    "link": _link,
    "sticks": _sticks,
}
"""Checks in order: the last one that finds a problem decides; landings continue."""
