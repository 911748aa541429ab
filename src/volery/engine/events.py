"""Defines events of UAVs and of the world."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from volery.core.clock import s_from_ns


class EventKind(StrEnum):
    """Kinds of events."""

    TOUCH_DOWN = "touch_down"
    """Touched the ground as a landing does."""
    IMPACT = "impact"
    """Hit the ground harder than a landing allows."""
    COLLISION = "collision"
    """Touched a tree, another solid or another UAV."""
    MODE = "mode"
    """Changed its flight mode."""
    BATTERY = "battery"
    """Its battery fell to low, critical, emergency or empty."""
    FAULT = "fault"
    """A planned fault began or ended."""
    WORLD = "world"
    """The world was changed, or a change rejected; without UAV."""


@dataclass(frozen=True)
class Event:
    """One event; `uav` is empty for an event without UAV.

    `partner` names the object of a contact, `detail` gives other information.
    """

    time_ns: int
    """Simulated time, ns."""
    uav: str
    """Name of the UAV; empty: the event is of no UAV."""
    kind: EventKind
    """Kind of the event."""
    position_map: tuple[float, float, float]
    """Position of the UAV, x, y, z, m, in the map."""
    speed_m_s: float
    """Speed just before a contact, m/s; 0: no contact."""
    partner: str = ""
    """Name of the object of a contact."""
    detail: str = ""
    """Other information, such as the new flight mode."""

    def describe(self) -> str:
        """Returns one line for users."""
        x, y, z = self.position_map
        where = f"at ({x:.1f}, {y:.1f}, {z:.1f}) m"
        time = f"{s_from_ns(self.time_ns):.3f} s"
        if self.kind is EventKind.WORLD:
            return f"{time}  {self.detail}"
        if self.kind in (EventKind.MODE, EventKind.BATTERY, EventKind.FAULT):
            return f"{time}  {self.uav} {self.detail} {where}"
        what = {
            EventKind.TOUCH_DOWN: "touched down",
            EventKind.IMPACT: "hit the ground",
            EventKind.COLLISION: f"hit {self.partner}",
        }[self.kind]
        return f"{time}  {self.uav} {what} at {self.speed_m_s:.2f} m/s {where}"
