"""What a battery level does to a flight: PX4's `COM_LOW_BAT_ACT` and its check before arming."""

from __future__ import annotations

from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.core.errors import CommandError
from volery.vehicle.battery import BatteryLevel
from volery.vehicle.plant_types import RigidBody

_ACTIONS = {
    ("land", BatteryLevel.CRITICAL): FlightMode.LAND,
    ("land", BatteryLevel.EMERGENCY): FlightMode.LAND,
    ("return", BatteryLevel.CRITICAL): FlightMode.RETURN,
    ("return", BatteryLevel.EMERGENCY): FlightMode.LAND,
}


def level_of(fleet: Fleet, row: int) -> BatteryLevel:
    """Returns the battery level of UAV `row`."""
    return BatteryLevel(int(fleet.state.battery_level[row]))


def mode_at(level: BatteryLevel, action: str) -> FlightMode | None:
    """Returns the mode that a type's `low_battery_action` enters at a level, None without one."""
    return _ACTIONS.get((action, level))


def check_charge(fleet: Fleet, row: int, action: str) -> None:
    """Raises `CommandError` if UAV `row` has too little charge for a take-off.

    Its battery is empty, or so low that `action`, its type's, would end the flight at once. Plants
    without rotors need no charge.
    """
    level, charge = level_of(fleet, row), float(fleet.state.battery_charge[row])
    is_driven = isinstance(fleet.plants[row], RigidBody)
    if mode_at(level, action) is None and not (level is BatteryLevel.EMPTY and is_driven):
        return
    why = f', at which low_battery_action = "{action}"' if level is not BatteryLevel.EMPTY else ""
    raise CommandError(
        f"{fleet.names[row]} cannot take off: its battery is {level.name.lower()} "
        f"({100.0 * charge:.0f} %){why}; a reset charges it"
    )
