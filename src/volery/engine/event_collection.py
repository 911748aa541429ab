"""Converts the landings, impacts and mode changes noted by the compiled steps to events."""

from __future__ import annotations

from collections.abc import Iterator

from volery.control.fleet import Fleet
from volery.control.fleet_events import FleetEvent, FleetEventKind
from volery.control.flight_modes import FlightMode
from volery.engine.events import Event, EventKind

_KINDS = {
    FleetEventKind.TOUCH_DOWN: EventKind.TOUCH_DOWN,
    FleetEventKind.IMPACT: EventKind.IMPACT,
    FleetEventKind.MODE: EventKind.MODE,
    FleetEventKind.BATTERY: EventKind.BATTERY,
}


def drain(fleet: Fleet, names: tuple[str, ...]) -> Iterator[Event]:
    """Yields the fleet's events since the last call, oldest first."""
    for noted in fleet.drain_events():
        if noted.kind is FleetEventKind.TOUCH_DOWN and noted.mode is FlightMode.LANDED:
            continue  # settles at its start position
        yield _event(noted, names[noted.uav], fleet.dt_ns)


def _event(noted: FleetEvent, name: str, dt_ns: int) -> Event:
    kind = _KINDS[noted.kind]
    detail = {
        EventKind.MODE: f"changed to {noted.mode.name}",
        EventKind.BATTERY: f"battery {noted.battery_level.name.lower()}",
    }.get(kind, "")
    return Event(
        noted.step * dt_ns,
        name,
        kind,
        noted.position_map,
        noted.speed_m_s,
        partner="" if detail else "ground",
        detail=detail,
    )
