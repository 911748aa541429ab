"""The leader's end of a divided run.

At a barrier it waits for what the workers have published, and passes it on; then it sends them what
its own nodes have published and its clients have commanded, with the step of the next barrier.
Where a worker's nodes may respond to that, the machines exchange again first.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import cbor2

from volery.cluster.division.barriers import Barriers, Due
from volery.cluster.division.exchange import (
    BATCH,
    CALL,
    COMMAND,
    EARLY,
    EXTERNAL,
    MESSAGE,
    RESPONSES,
    TICK,
    Inbox,
    Item,
    Outbox,
    state_hash,
)
from volery.cluster.division.link import Frame, Link, LinkError
from volery.cluster.division.node_services import NodeServices
from volery.core.errors import DivisionError, GraphError
from volery.graph.codecs.zero import zero_message
from volery.runtime.division_parts import DivisionParts

_SIZE_BYTES = 4


class Member:
    """A worker, as its leader sees it."""

    def __init__(self, link: Link, uavs: frozenset[str]) -> None:
        self.link = link
        self.uavs = uavs
        """UAVs that it serves."""
        self.due = Due(0, 0)
        """Steps at which something is due there."""
        self.timers = False
        """Whether timers are due there in the present tick."""
        self.topics: dict[str, Any] = {}
        """Type and latching of the topics that only it publishes."""
        self.services: dict[str, str] = {}
        """Types of the services of its nodes by name."""
        self.subscribed: frozenset[str] = frozenset()
        """Topics with subscribers there, and ..."""
        self.reacts: frozenset[str] = frozenset()
        """... those with nodes among them."""
        self.known_wishes: tuple[list[str], list[str]] | None = None
        """Topics that it knows to have subscribers, and external clients, elsewhere."""
        self.relayed: list[Item] = []
        """Items of other workers, to be sent."""
        self._history = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        self._num_sent = 0
        self.num_answered = 0
        """Frames sent since the start that a batch of the worker answers."""

    def send(self, *frame: Any) -> None:
        """Sends a frame, which a substitute will receive, too."""
        encoded = cbor2.dumps(frame)
        self._history.write(len(encoded).to_bytes(_SIZE_BYTES, "big") + encoded)
        self._num_sent += 1
        self.num_answered += frame[0] != EARLY
        self.link.send_bytes(encoded)

    def history(self) -> Iterator[bytes]:
        """Yields all frames so far."""
        self._history.seek(0)
        for _ in range(self._num_sent):
            yield self._history.read(int.from_bytes(self._history.read(_SIZE_BYTES), "big"))

    def update(self, due: Sequence[int], news: dict[str, Any]) -> None:
        """Takes over a worker's description of itself."""
        self.due = Due(*due)
        if news:
            self.topics, self.services = news["topics"], news["services"]
            self.subscribed = frozenset(news["subscribed"])
            self.reacts = frozenset(news["reacts"])

    def close(self) -> None:
        """Ends the connection."""
        self.link.close()
        self._history.close()


Substitute = Callable[[Member, str], Link | None]
"""Returns the connection to a machine that has repeated a lost worker's part so far, given the
worker and the reason of the loss; None: the run goes on without it."""


class Leader:
    """Implements an engine's `Division` on the leading machine."""

    def __init__(
        self, parts: DivisionParts, members: Sequence[Member], substitute: Substitute
    ) -> None:
        self._engine, self._graph = parts.engine, parts.graph
        self._members = list(members)
        self._substitute = substitute
        self._outbox = Outbox(parts.graph)
        self._inbox = Inbox(parts, self._outbox)
        self._node_services = NodeServices(parts.graph)
        self._inbox.on_answer = self._node_services.answer
        self._barriers = Barriers(parts)
        self._has_responses = self._has_timers = False
        self._seen_changes = -1
        self._exchanges = 0
        self._abandoned: list[str] = []
        parts.commands.on_noted = self._outbox.command
        for member in self._members:
            self._take_news(member)

    @property
    def at_barrier(self) -> bool:
        """Whether all machines are at the present step."""
        return self._barriers.is_open

    def begin_tick(self, last_step: int) -> int:
        """At a barrier, sends what has happened here until no worker responds, and ends it."""
        barriers = self._barriers
        while barriers.is_open:
            own = self._outbox.flush()
            pending = {member: self._items_for(member, own) for member in self._members}
            news = self._news()
            final = not any(
                news[member] or _may_respond(member, items) for member, items in pending.items()
            )
            dues = [barriers.due(), *(member.due for member in self._members)]
            next_step = max(min(last_step, *(due.first for due in dues)), self._engine.fleet.step)
            has_sensors = any(due.sensors <= next_step for due in dues)
            for member, items in pending.items():
                frame = [TICK, items, final, next_step, has_sensors, news[member]]
                self._call_member(member, partial(_send, frame))
            if final:
                barriers.close(next_step, has_sensors=has_sensors)
            else:
                self._receive()
        return min(last_step, barriers.next_step)

    def exchange_responses(self) -> None:
        """At a barrier, receives what the workers' nodes have responded.

        If timers are due anywhere, passes it on before they are called; else it can wait.
        """
        if not self._barriers.has_responses():
            return
        self._has_responses = True
        self._send_early()
        self._receive()
        self._has_timers = self._barriers.has_timers() or any(m.timers for m in self._members)
        if self._has_timers:
            own = self._outbox.flush()
            for member in tuple(self._members):
                frame = [RESPONSES, self._items_for(member, own)]
                self._call_member(member, partial(_send, frame))

    def end_tick(self) -> None:
        """At a barrier, receives what the workers' timers have caused."""
        if self._has_responses or self._barriers.is_due():
            if self._has_timers or not self._has_responses:
                self._send_early()
                self._receive()
            self._hold_abandoned()
            self._has_responses = self._has_timers = False
            self._barriers.is_open = True

    def _send_early(self) -> None:
        """Sends what no worker responds to, so that they apply it while this machine waits."""
        own = self._outbox.flush()
        for member in tuple(self._members):
            items = [item for item in own if _concerns(member, item)]
            if _may_respond(member, items):
                member.relayed += items
            elif items:
                self._call_member(member, partial(_send, [EARLY, items]))

    def _receive(self) -> None:
        own_hash = state_hash(self._engine.fleet, self._exchanges)
        self._exchanges += 1
        for member in tuple(self._members):
            frame = self._call_member(member, self._batch_of)
            if frame is None:
                continue
            _, items, due, timers, their_hash, news = frame
            member.update(due, news)
            member.timers = timers
            if their_hash != own_hash:
                raise DivisionError(
                    f"{member.link.name} computes other states than this machine at "
                    f"{self._engine.time_ns / 1e9:.3f} s: their processors or libraries differ"
                )
            if news:
                self._take_news(member)
            self._inbox.apply(items)
            for other in self._members:
                if other is not member:
                    other.relayed += [item for item in items if _concerns(other, item)]

    def end_round(self) -> None:
        """Notes that the effects of some commands have been delivered."""
        self._outbox.end_round()

    def _batch_of(self, member: Member) -> Frame:
        frame = member.link.receive()
        if frame[0] == "failed":
            raise PartError(member.link.name, *frame[1:])
        if frame[0] != BATCH or len(frame) != 6:
            raise LinkError(f"{member.link.name} sends a broken frame")
        return frame

    def _call_member(self, member: Member, act: Callable[[Member], Any]) -> Any:
        """Calls `act(member)`; on a loss, has its part taken over and tries again."""
        while member in self._members:
            try:
                return act(member)
            except LinkError as error:
                link = self._substitute(member, str(error))
                if link is None:
                    self._members.remove(member)
                    self._abandoned += sorted(member.uavs)
                    self._node_services.withdraw(member.services)
                    member.close()
                    return None
                member.link.close()
                member.link = link
                if act != self._batch_of:  # the frame is part of what the substitute has repeated
                    return None
        return None

    def _hold_abandoned(self) -> None:
        """Has the UAVs of workers that are not replaced hold their positions."""
        while self._abandoned:
            service = f"/{self._abandoned.pop()}/hold"
            request = zero_message("std_srvs/srv/Trigger_Request")
            self._outbox.call(service, request)
            with suppress(GraphError):  # the UAV has been deleted
                self._graph.call(service, request)

    def _items_for(self, member: Member, own: list[Item]) -> list[Item]:
        items = [*member.relayed, *(item for item in own if _concerns(member, item))]
        member.relayed = []
        return items

    def _news(self) -> dict[Member, list[list[str]] | None]:
        """Returns which topics of each worker have subscribers elsewhere, if that has changed."""
        found: dict[Member, list[list[str]] | None] = dict.fromkeys(self._members)
        if self._graph.changes == self._seen_changes:
            return found
        self._seen_changes = self._graph.changes
        here, all_shown = set(self._inbox.subscribed()), set(self._inbox.shown())
        for member in self._members:
            others = (other.subscribed for other in self._members if other is not member)
            elsewhere = here.union(*others)
            wanted = [topic for topic in member.topics if topic in elsewhere]
            shown = [topic for topic in member.topics if topic in all_shown]
            if (wanted, shown) != member.known_wishes:
                member.known_wishes = wanted, shown
                found[member] = [wanted, shown]
        return found

    def _take_news(self, member: Member) -> None:
        """Offers what a worker offers, and collects what workers need."""
        self._inbox.declare(member.topics)
        self._node_services.offer(member.link.name, member.services)
        self._outbox.want(frozenset().union(*(m.subscribed for m in self._members)))
        self._seen_changes = -1


def greeting_of(link: Link) -> tuple[Sequence[int], dict[str, Any]]:
    """Waits until a worker is ready; returns its description: see `Member.update`.

    Raises `DivisionError` if its part cannot start.
    """
    kind, *rest = link.receive()
    if kind == "failed":
        raise PartError(link.name, *rest)
    if kind != "ready" or len(rest) != 2:
        raise LinkError(f"{link.name} sends a broken frame")
    due, news = rest
    return due, news


class PartError(DivisionError):
    """A worker's part of the run has failed, as it would have here; the notes are its frames."""

    def __init__(self, worker: str, text: str, notes: Sequence[str] = ()) -> None:
        super().__init__(f"{worker}: {text}")
        for note in notes:
            self.add_note(note)


def _send(frame: Frame, member: Member) -> None:
    member.send(*frame)


def _concerns(member: Member, item: Item) -> bool:
    """Returns whether a worker needs an item."""
    if item[0] == EXTERNAL:
        return False
    return item[0] != MESSAGE or item[1] in member.subscribed


def _may_respond(member: Member, items: list[Item]) -> bool:
    """Returns whether nodes of a worker may publish because of these items."""
    return any(
        item[0] in (COMMAND, CALL) or (item[0] == MESSAGE and item[1] in member.reacts)
        for item in items
    )
