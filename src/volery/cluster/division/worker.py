"""A worker's end of a divided run: it follows the leader, from meeting to meeting."""

from __future__ import annotations

from typing import Any

from volery.cluster.division.exchange import Inbox, Outbox, state_hash
from volery.cluster.division.link import Link, LinkError
from volery.cluster.division.meetings import Meetings
from volery.core.errors import VoleryError
from volery.runtime.division_parts import DivisionParts


class RunEndedError(VoleryError):
    """The leader has ended the run."""


class Worker:
    """Implements an engine's `Division` on a worker.

    repeated: number of the leader's frames that a lost worker has answered already.
    """

    def __init__(self, parts: DivisionParts, link: Link, repeated: int = 0) -> None:
        self._engine, self._graph = parts.engine, parts.graph
        self._nodes = parts.nodes
        self._link = link
        self._outbox, self._inbox = Outbox(parts.graph), Inbox(parts)
        self._meetings = Meetings(parts)
        self._left_to_repeat = repeated
        self._told: dict[str, Any] = {}
        self._seen_changes = -1
        self._exchanges = 0

    def greet(self) -> None:
        """Sends what the leader must know before the first tick."""
        self._link.send("ready", self._meetings.due_step(), self._news())

    @property
    def meets(self) -> bool:
        """Whether all machines are at the present step."""
        return self._meetings.is_open

    def begin_tick(self, last_step: int) -> int:
        """At a meeting, takes over what has happened elsewhere, until the leader ends it.

        Raises `RunEndedError` when the leader ends the run.
        """
        meetings = self._meetings
        while meetings.is_open:
            kind, *rest = self._link.receive()
            if kind == "end":
                raise RunEndedError(str(rest[0]))
            if kind != "t" or len(rest) != 4:
                raise LinkError(f"{self._link.name} sends a broken frame")
            items, final, next_step, wishes = rest
            self._left_to_repeat = max(0, self._left_to_repeat - 1)
            if wishes is not None:
                self._outbox.want(frozenset(wishes[0]), frozenset(self._told.get("topics", ())))
                self._outbox.show_externally(wishes[1])
            self._inbox.apply(items)
            if final:
                meetings.close(int(next_step))
            else:
                self._send()
        return min(last_step, meetings.next_step)

    def end_tick(self) -> None:
        """At a meeting, sends what has been published here."""
        if self._meetings.comes():
            self._send()
            self._meetings.is_open = True

    def end_round(self) -> None:
        """Does nothing: a worker has no clients."""

    def _send(self) -> None:
        """Sends what has been published here, unless a lost worker has done so."""
        items = self._outbox.flush()
        own_hash = state_hash(self._engine.fleet, self._exchanges)
        self._exchanges += 1
        if not self._left_to_repeat:
            self._link.send("b", items, self._meetings.due_step(), own_hash, self._news())

    def _news(self) -> dict[str, Any]:
        """Returns the topics published and needed here, if they have changed."""
        if self._graph.changes == self._seen_changes:
            return {}
        self._seen_changes = self._graph.changes
        reacts = frozenset().union(*(node.endpoints().subscribes for node in self._nodes()))
        found = {
            "topics": {name: list(of) for name, of in self._graph.local_topics().items()},
            "subscribed": sorted(self._graph.subscribed_topics()),
            "reacts": sorted(reacts),
        }
        if found == self._told:
            return {}
        self._told = found
        return found
