"""The leader's end of a divided run.

At the end of each tick it waits for what the workers have published, and passes it on; at the
beginning of the next one it sends them what its own nodes have published and its clients have
commanded, with the step at which the tick ends: the earliest at which anything is due anywhere.
Where a worker's nodes may respond to that, the machines exchange again before the tick.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import cbor2

from volery.cluster.division.exchange import (
    CALL,
    COMMAND,
    EXTERNAL,
    MESSAGE,
    Inbox,
    Item,
    Outbox,
    state_hash,
)
from volery.cluster.division.link import Frame, Link, LinkError
from volery.core.errors import DivisionError, VoleryError
from volery.runtime.division_parts import DivisionParts

_SIZE_BYTES = 4


class Member:
    """A worker, as its leader sees it."""

    def __init__(self, link: Link, uavs: frozenset[str]) -> None:
        self.link = link
        self.uavs = uavs
        """UAVs that it serves."""
        self.due = 0
        """Step at which something is due there."""
        self.topics: dict[str, Any] = {}
        """Type and latching of the topics that only it publishes."""
        self.subscribed: frozenset[str] = frozenset()
        """Topics with subscribers there, and ..."""
        self.reacts: frozenset[str] = frozenset()
        """... those with nodes among them."""
        self.told: tuple[list[str], list[str]] | None = None
        """Topics that it knows to have subscribers, and external clients, elsewhere."""
        self.relayed: list[Item] = []
        """Items of other workers, to be sent."""
        self._history = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        self.num_sent = 0
        """Frames sent since the start."""

    def send(self, *frame: Any) -> None:
        """Sends a frame, which a substitute will receive, too."""
        encoded = cbor2.dumps(frame)
        self._history.write(len(encoded).to_bytes(_SIZE_BYTES, "big") + encoded)
        self.num_sent += 1
        self.link.send_bytes(encoded)

    def history(self) -> Iterator[bytes]:
        """Yields all frames so far."""
        self._history.seek(0)
        for _ in range(self.num_sent):
            yield self._history.read(int.from_bytes(self._history.read(_SIZE_BYTES), "big"))

    def heard(self, due: int, news: dict[str, Any]) -> None:
        """Takes over what a worker tells of itself."""
        self.due = due
        self.topics = news.get("topics", self.topics)
        if "subscribed" in news:
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
        self._outbox, self._inbox = Outbox(parts.graph), Inbox(parts)
        self._seen_changes = -1
        self._exchanges = 0
        parts.commands.on_noted = self._outbox.command
        for member in self._members:
            self._inbox.declare(member.topics)
        self._note_wishes()

    def begin_tick(self, last_step: int) -> int:
        """Sends what has happened here, until no worker responds; returns the tick's end."""
        while True:
            own = self._outbox.flush()
            pending = {member: self._items_for(member, own) for member in self._members}
            final = not any(_may_respond(member, items) for member, items in pending.items())
            end = min([self._engine.horizon(last_step), *(m.due for m in self._members)])
            end = max(end, self._engine.fleet.step)
            for member, items in pending.items():
                frame = ["t", items, final, end, self._news_for(member)]
                self._reach(member, partial(_send, frame))
            if final:
                return end
            self.end_tick()

    def end_tick(self) -> None:
        """Receives and applies what the workers have published."""
        own_hash = state_hash(self._engine.fleet, self._exchanges)
        self._exchanges += 1
        for member in tuple(self._members):
            frame = self._reach(member, self._batch_of)
            if frame is None:
                continue
            _, items, due, their_hash, news = frame
            member.heard(due, news)
            if their_hash != own_hash:
                raise DivisionError(
                    f"{member.link.name} computes other states than this machine at "
                    f"{self._engine.time_ns / 1e9:.3f} s: their processors or libraries differ"
                )
            if "topics" in news:
                self._inbox.declare(member.topics)
            if news:
                self._note_wishes()
            self._inbox.apply(items)
            for other in self._members:
                if other is not member:
                    other.relayed += [item for item in items if _concerns(other, item)]

    def end_round(self) -> None:
        """Notes that the effects of some commands have been delivered."""
        self._outbox.end_round()

    def close(self, reason: str) -> None:
        """Ends the workers' parts."""
        for member in self._members:
            try:
                member.link.send("end", reason)
            except VoleryError:
                continue  # it has ended already
            finally:
                member.close()

    def _batch_of(self, member: Member) -> Frame:
        frame = member.link.receive()
        if frame[0] == "failed":
            raise _FailedError(f"{member.link.name}: {frame[1]}")
        if frame[0] != "b" or len(frame) != 5:
            raise LinkError(f"{member.link.name} sends a broken frame")
        return frame

    def _reach(self, member: Member, act: Callable[[Member], Any]) -> Any:
        """Calls `act(member)`; on a loss, has its part taken over and tries again."""
        while member in self._members:
            try:
                return act(member)
            except LinkError as error:
                link = self._substitute(member, str(error))
                if link is None:
                    self._members.remove(member)
                    member.close()
                    return None
                member.link.close()
                member.link = link
                if act != self._batch_of:  # the frame is part of what the substitute has repeated
                    return None
        return None

    def _items_for(self, member: Member, own: list[Item]) -> list[Item]:
        items = [*member.relayed, *(item for item in own if _concerns(member, item))]
        member.relayed = []
        return items

    def _news_for(self, member: Member) -> list[list[str]] | None:
        """Returns which of its topics have subscribers elsewhere, if that has changed."""
        if self._graph.changes != self._seen_changes:
            self._seen_changes = self._graph.changes
            self._subscribed = frozenset(self._inbox.subscribed())
            self._shown = frozenset(self._inbox.shown())
        others: set[str] = set()
        for other in self._members:
            if other is not member:
                others |= other.subscribed
        wanted = [t for t in member.topics if t in self._subscribed or t in others]
        shown = [topic for topic in member.topics if topic in self._shown]
        if (wanted, shown) == member.told:
            return None
        member.told = wanted, shown
        return [wanted, shown]

    def _note_wishes(self) -> None:
        """Collects what workers need."""
        self._outbox.want(frozenset().union(*(m.subscribed for m in self._members)))
        self._seen_changes = -1


def greeting_of(link: Link) -> tuple[int, dict[str, Any]]:
    """Waits until a worker is ready; returns what it tells of itself: see `Member.heard`.

    Raises `DivisionError` if its part cannot start.
    """
    kind, *rest = link.receive()
    if kind == "failed":
        raise _FailedError(f"{link.name}: {rest[0]}")
    if kind != "ready" or len(rest) != 2:
        raise LinkError(f"{link.name} sends a broken frame")
    due, news = rest
    return int(due), news


class _FailedError(DivisionError):
    """A worker's part of the run has failed, as it would have here."""


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
