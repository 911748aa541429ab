"""A worker's end of a divided run: it follows the leader, from barrier to barrier."""

from __future__ import annotations

from typing import Any

from volery.cluster.division.barriers import Barriers
from volery.cluster.division.exchange import (
    BATCH,
    EARLY,
    RESPONSES,
    TICK,
    Inbox,
    Outbox,
    state_hash,
)
from volery.cluster.division.link import Frame, Link, LinkError
from volery.core.errors import VoleryError
from volery.runtime.division_parts import DivisionParts


class RunEndedError(VoleryError):
    """The leader has ended the run."""


class Worker:
    """Implements an engine's `Division` on a worker.

    repeated: number of the leader's frames, but the early ones, that a lost worker was sent.
    """

    def __init__(self, parts: DivisionParts, link: Link, repeated: int = 0) -> None:
        self._engine, self._graph = parts.engine, parts.graph
        self._nodes = parts.nodes
        self._link = link
        self._outbox = Outbox(parts.graph)
        self._inbox = Inbox(parts, self._outbox)
        self._barriers = Barriers(parts)
        self._has_responses = self._has_timers = False
        self._waiting: Frame | None = None
        """Frame that begins the next tick."""
        self._left_to_repeat = repeated
        self._announced: dict[str, Any] = {}
        self._seen_changes = -1
        self._exchanges = 0

    def greet(self) -> None:
        """Sends what the leader must know before the first tick."""
        self._link.send("ready", self._barriers.due(), self._news())

    @property
    def at_barrier(self) -> bool:
        """Whether all machines are at the present step."""
        return self._barriers.is_open

    def begin_tick(self, last_step: int) -> int:
        """At a barrier, takes over what has happened elsewhere, until the leader ends it.

        Raises `RunEndedError` when the leader ends the run.
        """
        barriers = self._barriers
        while barriers.is_open:
            kind, *rest = self._waiting or self._receive()
            self._waiting = None
            if kind == "end":
                raise RunEndedError(str(rest[0]))
            if kind != TICK or len(rest) != 5:
                raise LinkError(f"{self._link.name} sends a broken frame")
            items, final, next_step, has_sensors, wishes = rest
            self._left_to_repeat = max(0, self._left_to_repeat - 1)
            if wishes is not None:
                known = frozenset(self._announced.get("topics", ()))
                self._outbox.want(frozenset(wishes[0]), known)
                self._outbox.show_externally(wishes[1])
            self._inbox.apply(items)
            if final:
                barriers.close(int(next_step), has_sensors=bool(has_sensors))
            else:
                self._send()
        return min(last_step, barriers.next_step)

    def exchange_responses(self) -> None:
        """At a barrier, sends what the nodes here have responded, and waits for the others."""
        if not self._barriers.has_responses():
            return
        self._has_responses = True
        self._send()
        frame = self._receive()
        if frame[0] != RESPONSES:  # no timers anywhere: the next tick begins
            self._waiting = frame
            return
        self._has_timers = True
        self._left_to_repeat = max(0, self._left_to_repeat - 1)
        self._inbox.apply(frame[1])

    def end_tick(self) -> None:
        """At a barrier, sends what timers have caused here."""
        if self._has_responses or self._barriers.is_due():
            if self._has_timers or not self._has_responses:
                self._send()
            self._has_responses = self._has_timers = False
            self._barriers.is_open = True

    def end_round(self) -> None:
        """Does nothing: a worker has no clients."""

    def _receive(self) -> Frame:
        """Returns the next frame of the leader; applies the early ones before it."""
        while (frame := self._link.receive())[0] == EARLY:
            self._inbox.apply(frame[1])
        return frame

    def _send(self) -> None:
        """Sends what has been published here, unless a lost worker has done so."""
        items = self._outbox.flush()
        own_hash = state_hash(self._engine.fleet, self._exchanges)
        self._exchanges += 1
        if not self._left_to_repeat:
            due, timers = self._barriers.due(), self._barriers.has_timers()
            self._link.send(BATCH, items, due, timers, own_hash, self._news())

    def _news(self) -> dict[str, Any]:
        """Returns the topics published and needed here, if they have changed."""
        if self._graph.changes == self._seen_changes:
            return {}
        self._seen_changes = self._graph.changes
        ends = [node.endpoints() for node in self._nodes()]
        served = sorted(frozenset().union(*(each.serves for each in ends)))
        self._inbox.node_services = frozenset(served)
        found = {
            "services": {name: self._graph.service_type(name) for name in served},
            "topics": {name: list(of) for name, of in self._graph.local_topics().items()},
            "subscribed": sorted(self._graph.subscribed_topics()),
            "reacts": sorted(frozenset().union(*(each.subscribes for each in ends))),
        }
        if found == self._announced:
            return {}
        self._announced = found
        return found
