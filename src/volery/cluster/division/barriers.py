"""Barriers: when the machines of a divided run exchange what they publish.

Between two barriers each machine runs by itself, in ticks of its own. They meet at the next step at
which a node may act anywhere: when a sensor measures to whose messages nodes respond, a timer is
due, or an event has happened. All compute the same events, so all stop for them. A barrier has up
to two exchanges: of responses to sensors' messages, and of what timers have caused then.
"""

from __future__ import annotations

from typing import NamedTuple

from volery.core.errors import DivisionError
from volery.engine.engine import SensorBank
from volery.runtime.division_parts import DivisionParts

_FAR = 1 << 62


class Due(NamedTuple):
    """The next steps at which nodes of a machine may act."""

    sensors: int
    """Next step with a message of a sensor to which a node responds, or that crosses."""
    others: int
    """Next step of a timer or a lock-step partner."""

    @property
    def first(self) -> int:
        """The earlier of the two."""
        return min(self)


class Barriers:
    """The barriers as one machine sees them."""

    def __init__(self, parts: DivisionParts) -> None:
        self._engine, self._graph = parts.engine, parts.graph
        self._causes_actions = parts.causes_actions
        self._active: dict[int, bool] = {}
        """Whether nodes may act on messages of a bank, by the bank's `id`."""
        self._seen_changes = -1
        self._events = 0
        self._next = 0
        self._has_sensors = True
        self.is_open = True
        """Whether the machines are at one step and have exchanged what came before."""

    def close(self, next_step: int, *, has_sensors: bool) -> None:
        """Ends a barrier; the next one is at `next_step`, or after an event.

        has_sensors: nodes may respond to sensors' messages there.
        """
        self.is_open, self._next, self._has_sensors = False, next_step, has_sensors
        self._events = self._engine.num_events

    def is_due(self) -> bool:
        """Returns whether the machines meet at the end of this tick."""
        return self._engine.fleet.step >= self._next or self._has_events

    def has_responses(self) -> bool:
        """Returns whether the machines exchange responses to sensors' messages and events now.

        Raises `DivisionError` for a timer of which the other machines cannot know.
        """
        if self.is_due():
            return self._has_sensors or self._has_events
        if self.has_timers():
            raise DivisionError(
                "a timer is due between two barriers: the callback of a passive subscription has "
                "started it; omit passive=True"
            )
        return False

    def has_timers(self) -> bool:
        """Returns whether timers are due on this machine in the present tick."""
        due = (self._engine.timer_agenda.next_step(), self._engine.deadlines.next_step())
        return any(step is not None and step <= self._engine.fleet.step for step in due)

    @property
    def next_step(self) -> int:
        """Step of the next barrier, unless an event comes first."""
        return self._next

    @property
    def _has_events(self) -> bool:
        return self._engine.num_events != self._events

    def due(self) -> Due:
        """Returns the next steps at which nodes of this machine may act."""
        engine = self._engine
        if self._graph.changes != self._seen_changes:
            self._seen_changes = self._graph.changes
            self._active.clear()
        sensors = engine.sensor_agenda.next_step_of(self._is_active)
        others = (
            engine.timer_agenda.next_step(),
            engine.partner_agenda.next_step(),
            engine.deadlines.next_step(),
        )
        return Due(
            _FAR if sensors is None else sensors,
            min((step for step in others if step is not None), default=_FAR),
        )

    def _is_active(self, bank: SensorBank) -> bool:
        found = self._active.get(id(bank))
        if found is None:
            found = self._active[id(bank)] = self._causes_actions(bank)
        return found
