"""Warns of falling batteries, and lands or returns UAVs as their type's `low_battery_action` says.

Levels and actions are those of PX4 (`COM_LOW_BAT_ACT`), which by default warns and does nothing.
"""

from __future__ import annotations

import logging
from collections.abc import Callable

from volery.control.flight_modes import DOWN_MODES, FlightMode
from volery.engine.engine import Engine
from volery.engine.events import Event, EventKind
from volery.runtime.vehicles.low_battery import level_of, mode_at
from volery.runtime.vehicles.uav import Uav
from volery.scenario.schema import Scenario
from volery.vehicle.battery import BatteryLevel
from volery.vehicle.plant_types import RigidBody

_log = logging.getLogger(__name__)


class BatteryFailsafe:
    """Acts on the battery events of a run, each once; a later command replaces its action.

    find: returns the UAV of a name, None if there is none.
    """

    def __init__(self, engine: Engine, find: Callable[[str], Uav | None]) -> None:
        self._engine = engine
        self._find = find

    def happened(self, event: Event, scenario: Scenario) -> None:
        """Logs a battery event and starts its action, which is an event of its own."""
        uav = self._find(event.uav) if event.kind is EventKind.BATTERY else None
        if uav is None:
            return
        row = self._engine.names.index(uav.name)
        level = level_of(self._engine.fleet, row)
        mode = self._action(scenario.types[uav.type_name].flight.low_battery_action, level, uav)
        consequence = "" if mode is None else _CONSEQUENCES[mode]
        if level is BatteryLevel.EMPTY and uav.mode not in DOWN_MODES:
            has_rotors = isinstance(self._engine.fleet.plants[row], RigidBody)
            consequence = ": its rotors stop" if has_rotors else ": its plant flies on without it"
        _log.warning(
            "%.1f s: %s: %s, %.0f %% left%s",
            event.time_ns * 1e-9,
            uav.name,
            event.detail,
            100.0 * uav.battery_charge,
            consequence,
        )
        if mode is FlightMode.LAND:
            uav.land()
        elif mode is FlightMode.RETURN:
            uav.return_home()
        if mode is not None:
            self._engine.note(row, EventKind.MODE, f"changed to {mode.name}: {event.detail}")

    def _action(self, action: str, level: BatteryLevel, uav: Uav) -> FlightMode | None:
        """Returns the mode that a UAV enters at a battery level; landings continue."""
        mode = mode_at(level, action)
        if mode is None or uav.mode in (*DOWN_MODES, FlightMode.LAND, mode):
            return None
        return mode


_CONSEQUENCES = {FlightMode.LAND: ": it lands", FlightMode.RETURN: ": it returns home"}
