"""Events of a fleet's UAVs, recorded by the compiled step."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from volery.control.flight_modes import FlightMode
from volery.control.fused_step import BATTERY_FELL, MODE_CHANGE
from volery.vehicle.battery import BatteryLevel
from volery.vehicle.contact import IMPACT, TOUCH_DOWN


class FleetEventKind(StrEnum):
    """Kinds of events."""

    TOUCH_DOWN = "touch_down"
    """Touched the ground within the limits of a landing."""
    IMPACT = "impact"
    """Touched the ground faster than the landing limit or tilted beyond 60 degrees."""
    MODE = "mode"
    """Changed its flight mode without a command."""
    BATTERY = "battery"
    """The battery level fell."""


_KINDS = {
    TOUCH_DOWN: FleetEventKind.TOUCH_DOWN,
    IMPACT: FleetEventKind.IMPACT,
    MODE_CHANGE: FleetEventKind.MODE,
    BATTERY_FELL: FleetEventKind.BATTERY,
}


@dataclass(frozen=True, slots=True)
class FleetEvent:
    """One event."""

    kind: FleetEventKind
    step: int
    """Physics step at the end of which it happened."""
    uav: int
    """Row of the UAV in the fleet."""
    position_map: tuple[float, float, float]
    """Position, m, map frame."""
    speed_m_s: float
    """Speed of the centre of mass just before a contact; 0 for a change of mode."""
    mode: FlightMode
    """Mode after a change, or during a contact."""
    battery_level: BatteryLevel = BatteryLevel.NORMAL
    """Battery level at that time."""


def event_of(row: Any) -> FleetEvent:
    """Returns the event of an `EVENT` row."""
    x, y, z = row["position"].tolist()
    return FleetEvent(
        _KINDS[int(row["kind"])],
        int(row["step"]),
        int(row["uav"]),
        (x, y, z),
        float(row["speed"]),
        FlightMode(int(row["mode"])),
        BatteryLevel(int(row["level"])),
    )
