"""Barriers: when the machines of a divided run exchange what they publish.

Between two barriers each machine runs by itself, in ticks of its own. They meet at the next step at
which a node may act anywhere: when a sensor measures whose messages are delivered, a timer is due,
or an event has happened. All compute the same events, so all stop for them. A barrier has up to two
exchanges: of responses to sensors' messages, and of what timers have caused then.
"""

from __future__ import annotations

from volery.engine.engine import SensorBank
from volery.runtime.division_parts import DivisionParts

_FAR = 1 << 62


class Barriers:
    """The barriers as one machine sees them."""

    def __init__(self, parts: DivisionParts) -> None:
        self._engine, self._graph = parts.engine, parts.graph
        self._has_receivers = parts.has_receivers
        self._active: dict[int, bool] = {}
        """Whether messages of a bank are delivered, by the bank's `id`."""
        self._seen_changes = -1
        self._events = 0
        self._next = 0
        self.is_open = True
        """Whether the machines are at one step and have exchanged what came before."""

    def close(self, next_step: int) -> None:
        """Ends a barrier; the next one is at `next_step`, or after an event."""
        self.is_open, self._next = False, next_step
        self._events = self._engine.num_events

    def is_due(self) -> bool:
        """Returns whether the machines meet at the end of this tick."""
        here = self._engine.fleet.step >= self._next
        return here or self._engine.num_events != self._events

    def has_timers(self) -> bool:
        """Returns whether timers are due on this machine in the present tick."""
        due = (self._engine.timer_agenda.next_step(), self._engine.deadlines.next_step())
        return any(step is not None and step <= self._engine.fleet.step for step in due)

    @property
    def next_step(self) -> int:
        """Step of the next barrier, unless an event comes first."""
        return self._next

    def due_step(self) -> int:
        """Returns the next step at which nodes of this machine may act."""
        engine = self._engine
        if self._graph.changes != self._seen_changes:
            self._seen_changes = self._graph.changes
            self._active.clear()
        steps = (
            engine.sensor_agenda.next_step_of(self._is_active),
            engine.timer_agenda.next_step(),
            engine.partner_agenda.next_step(),
            engine.deadlines.next_step(),
        )
        return min((step for step in steps if step is not None), default=_FAR)

    def _is_active(self, bank: SensorBank) -> bool:
        found = self._active.get(id(bank))
        if found is None:
            found = self._active[id(bank)] = self._has_receivers(bank)
        return found
