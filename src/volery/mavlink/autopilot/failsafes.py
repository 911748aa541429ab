"""Failsafes: monitor the UAV and change the mode on problems, on simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from volery.mavlink.autopilot import arming, mode_requirements, mode_transitions
from volery.mavlink.autopilot.geofence import breach
from volery.mavlink.autopilot.modes import Mode

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot
    from volery.mavlink.autopilot.vehicle import FlightState

PERIOD_NS = 100_000_000
"""Time between two checks (modelling choice)."""
_FIX_PATIENCE_NS = 5_000_000_000
"""Time without a fix after which the estimate is invalid, PX4's EKF2_NOAID_TOUT."""


def check(autopilot: Autopilot, state: FlightState) -> None:
    """Checks for problems; reports each problem once and acts on it once."""
    memory = autopilot.memory
    memory.fix_lost = memory.now_ns - memory.fix_ns > _FIX_PATIENCE_NS
    flies = memory.armed and mode_transitions.flies(autopilot)
    for name, look in _LOOKS.items():
        found = look(autopilot, state) if flies or name.startswith("battery") else None
        if found is None:
            memory.warned.discard(name)
        elif name not in memory.warned:
            memory.warned.add(name)
            text, mode = found
            autopilot.say(2 if mode else 4, text)
            if flies:
                act(autopilot, mode)


def act(autopilot: Autopilot, mode: Mode | None) -> None:
    """Enters the mode of a failsafe; landings continue.

    A UAV without a position lands at once.
    """
    memory = autopilot.memory
    if mode is None:
        return
    if memory.fix_lost:
        mode = Mode.LAND
    if memory.mode is Mode.LAND or (memory.mode is Mode.RETURN and mode is Mode.HOLD):
        return
    memory.failsafe = True
    if mode is not memory.mode or (mode is Mode.HOLD and _is_under_way(autopilot)):
        mode_transitions.enter(autopilot, mode)


def _is_under_way(autopilot: Autopilot) -> bool:
    """Returns whether a UAV in hold flies to a position.

    The cause is a reposition or another client's command.
    """
    return autopilot.memory.leg is not None or autopilot.memory.order not in ("hold", "HOLD")


def _position(autopilot: Autopilot, _state: FlightState) -> tuple[str, Mode | None] | None:
    if not autopilot.memory.fix_lost or autopilot.memory.mode is Mode.ALTITUDE:
        return None
    return "Failsafe: position lost, landing", Mode.LAND


def _battery(level: str) -> Callable[[Autopilot, FlightState], tuple[str, Mode | None] | None]:
    def look(autopilot: Autopilot, state: FlightState) -> tuple[str, Mode | None] | None:
        threshold = float(autopilot.parameter(f"BAT_{level}_THR"))
        if not (math.isfinite(state.charge) and state.charge < threshold):
            return None
        action = int(autopilot.parameter("COM_LOW_BAT_ACT"))
        mode = None
        if level == "CRIT":
            mode = {2: Mode.LAND, 3: Mode.RETURN}.get(action)
        elif level == "EMERGEN":
            mode = {2: Mode.LAND, 3: Mode.LAND}.get(action)
        word = {"LOW": "Low", "CRIT": "Critical", "EMERGEN": "Emergency"}[level]
        return f"{word} battery level", mode

    return look


def _fence(autopilot: Autopilot, state: FlightState) -> tuple[str, Mode | None] | None:
    action = int(autopilot.parameter("GF_ACTION"))
    broken = breach(autopilot, state.position) if action else ""
    if not broken:
        return None
    if action == 4:
        arming.disarm(autopilot, forced=True)
    mode = {2: Mode.HOLD, 3: Mode.RETURN, 5: Mode.LAND}.get(action)
    return f"Geofence violation: {broken}", mode


def _link(autopilot: Autopilot, _state: FlightState) -> tuple[str, Mode | None] | None:
    """Checks the ground link.

    As in PX4, a link never seen counts as lost, and landings continue.
    """
    action = int(autopilot.parameter("NAV_DLL_ACT"))
    if not action or mode_requirements.ground_is_there(autopilot):
        return None
    if autopilot.memory.mode is Mode.LAND and "link" not in autopilot.memory.warned:
        return None
    mode = {1: Mode.HOLD, 2: Mode.RETURN, 3: Mode.LAND}[action]
    return "Failsafe: connection to ground station lost", mode


def _sticks(autopilot: Autopilot, _state: FlightState) -> tuple[str, Mode | None] | None:
    if not autopilot.memory.mode.by_sticks or mode_requirements.sticks_are_there(autopilot):
        return None
    mode = {1: Mode.HOLD, 3: Mode.LAND}.get(int(autopilot.parameter("NAV_RCL_ACT")), Mode.RETURN)
    return "Failsafe: manual control lost", mode


_LOOKS: dict[str, Callable[[Autopilot, FlightState], tuple[str, Mode | None] | None]] = {
    "position": _position,
    "battery low": _battery("LOW"),
    "battery critical": _battery("CRIT"),
    "battery emergency": _battery("EMERGEN"),
    "fence": _fence,
    "link": _link,
    "sticks": _sticks,
}
"""Checks in order: the last one that finds a problem decides; landings continue."""
