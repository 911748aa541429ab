"""What happened to the UAVs of a fleet, as the compiled step noted it."""

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
    """Touched the ground as a landing may."""
    IMPACT = "impact"
    """Touched the ground faster than the landing limit or tilted beyond 60 degrees."""
    MODE = "mode"
    """Changed its flight mode by itself."""
    BATTERY = "battery"
    """Its battery fell to a lower level."""


_KINDS = {
    TOUCH_DOWN: FleetEventKind.TOUCH_DOWN,
    IMPACT: FleetEventKind.IMPACT,
    MODE_CHANGE: FleetEventKind.MODE,
    BATTERY_FELL: FleetEventKind.BATTERY,
}


@dataclass(frozen=True, slots=True)
class FleetEvent:
    """One happening."""

    kind: FleetEventKind
    step: int
    """Physics step at whose end it happened."""
    uav: int
    """Row."""
    position_map: tuple[float, float, float]
    """m."""
    speed_m_s: float
    """Of the centre of mass just before a touch; 0 for a change of mode."""
    mode: FlightMode
    """Mode after a change, mode in which a touch happened."""
    battery_level: BatteryLevel = BatteryLevel.NORMAL
    """At the time."""


def event_of(row: Any) -> FleetEvent:
    """An `EVENT` row."""
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
