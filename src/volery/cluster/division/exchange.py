"""What crosses between the machines of a divided run: items, in the order in which they acted.

Each machine collects the items of its own nodes, LIDARs and cameras; the leader also collects the
commands of its clients. Another machine applies them at the same simulated time, in this order.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Collection
from contextlib import suppress
from typing import Any

import numpy as np

from volery.control.fleet import Fleet
from volery.core.errors import GraphError, VoleryError
from volery.graph import command_records as records
from volery.graph.codecs.cdr import decode_cdr, encode_cdr
from volery.graph.graph import Graph
from volery.graph.messages import Published
from volery.graph.service_reply import ServiceReply
from volery.graph.session import ClientCommand
from volery.graph.topics import Publisher, Subscription
from volery.runtime.division_parts import DivisionParts

_HASH_PERIOD = 32
"""Exchanges from one comparison of states to the next."""

Item = list[Any]
"""An item: its kind and what belongs to it."""
MESSAGE, EXTERNAL, CALL, COMMAND, ROUND, ANSWER = "m", "e", "s", "k", "r", "w"
"""A message; one for external clients only; a service call of a node; a command of a client; the
end of a round of commands, whose messages are delivered then; a node's response to a client."""


TICK, RESPONSES, EARLY, BATCH = "t", "a", "e", "b"
"""Frames of the leader: what precedes a tick, or timers, and items that no batch answers; the batch
of a worker, which answers the others."""


class Outbox:
    """Collects what this machine does that the others cannot know."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._items: list[Item] = []
        self._attached: dict[str, Subscription] = {}
        self._wanted: Collection[str] = frozenset()
        self._declared: Collection[str] | None = frozenset()
        self._matching: frozenset[str] = frozenset()
        self._seen_changes = -1
        self._tap = graph.subscribe_all(self._take, self._is_wanted, is_machine=True)
        graph.on_node_call = self.call

    def want(self, wanted: Collection[str], declared: Collection[str] | None = None) -> None:
        """Collects messages on the topics `wanted`, which have subscribers on other machines.

        declared: topics whose subscribers are known; messages on others are collected, too. None:
        those on all topics are.
        """
        self._wanted, self._declared = wanted, declared
        self._graph.count_change()

    def flush(self) -> list[Item]:
        """Returns the items since the last call."""
        items, self._items = self._items, []
        return items

    def call(self, service: str, request: Any) -> None:
        """Adds a call of a service by a node."""
        if self._graph.has_service(service):
            srvtype = self._graph.service_type(service)
            self._items.append([CALL, service, srvtype, encode_cdr(request, f"{srvtype}_Request")])

    def command(self, command: ClientCommand) -> None:
        """Adds a command of a client that is about to take effect."""
        if command.kind in ("refused", "end"):  # follow from the others
            return
        client, kind, name, msgtype, _, latched, request = command
        content = records.content_bytes(command)
        self._items.append([COMMAND, client, kind, name, msgtype, content, latched, request])

    def answer(self, service: str, cdr: bytes, failure: str = "") -> None:
        """Adds the response of a node's service to a client, or why there is none."""
        self._items.append([ANSWER, service, cdr, failure])

    def end_round(self) -> None:
        """Adds the end of a round of commands."""
        if self._items and self._items[-1][0] != ROUND:
            self._items.append([ROUND])

    def show_externally(self, topics: Collection[str]) -> None:
        """Collects also what goes to external clients only, on the topics that they receive."""
        for topic in self._attached.keys() - set(topics):
            self._attached.pop(topic).cancel()
        for topic in sorted(set(topics) - self._attached.keys()):
            msgtype = self._graph.topic_type(topic)
            if msgtype is not None:
                self._attached[topic] = self._graph.attach(topic, self._take_external, msgtype)

    def _is_wanted(self, topic: str) -> bool:
        if self._graph.changes != self._seen_changes:
            self._seen_changes = self._graph.changes
            known, wanted = self._declared, self._wanted
            self._matching = frozenset(
                name
                for name in self._graph.local_topics()
                if name in wanted or (known is not None and name not in known)
            )
        return topic in self._matching

    def _take(self, published: Published) -> None:
        sender = self._graph.sender
        if sender is not None and sender.local:
            self._items.append([MESSAGE, published.topic, published.msgtype, published.cdr])

    def _take_external(self, published: Published) -> None:
        if self._graph.sender is None:
            self._items.append([EXTERNAL, published.topic, published.msgtype, published.cdr])


class Inbox:
    """Applies the items of other machines; `outbox` receives responses of nodes' services."""

    def __init__(self, parts: DivisionParts, outbox: Outbox) -> None:
        self._graph = parts.graph
        self._outbox = outbox
        self.node_services: Collection[str] = frozenset()
        """Services of nodes of this machine, whose responses go back."""
        self.on_answer: Callable[[str, bytes, str], None] = lambda *_: None
        """Receives name, response and failure of a call of a service on another machine."""
        self._repeater = parts.repeater
        self._publishers: dict[str, Publisher] = {}

    def declare(self, topics: dict[str, Any]) -> None:
        """Advertises topics of other machines: type and latching by name."""
        for topic, (msgtype, latched) in topics.items():
            known = self._publishers.get(topic)
            if known is None or known.latched != latched:
                self._publishers[topic] = self._graph.advertise(topic, msgtype, latched=latched)
                if known is not None:
                    known.cancel()

    def subscribed(self) -> list[str]:
        """Returns the topics of other machines whose messages are needed here."""
        return [name for name, publisher in self._publishers.items() if publisher.has_subscribers]

    def shown(self) -> list[str]:
        """Returns the topics of other machines that external clients receive."""
        publishers = self._publishers.items()
        return [name for name, publisher in publishers if publisher.has_external_subscribers]

    def apply(self, items: list[Item]) -> None:
        """Applies items in their order. Raises `GraphError` for one that does not fit."""
        for kind, *rest in items:
            if kind == ROUND:
                self._graph.deliver()
            elif kind == COMMAND:
                self._command(_command_of(rest))
            elif kind == ANSWER:
                self.on_answer(*rest)
            elif kind == CALL:
                self._call(*rest)
            else:
                self._publish(*rest, externally=kind == EXTERNAL)

    def _command(self, command: ClientCommand) -> None:
        if command.kind == "call" and command.name in self.node_services:
            self._serve(command)
        else:
            self._repeater.repeat(command)

    def _serve(self, command: ClientCommand) -> None:
        """Calls a service of a node for a client of the leader."""
        name, outbox = command.name, self._outbox
        reply = ServiceReply(
            lambda answer: outbox.answer(name, encode_cdr(answer, f"{command.type}_Response")),
            lambda error: outbox.answer(name, b"", str(error)),
        )
        try:
            with self._graph.on_behalf_of(command.client):
                self._graph.call_async(name, command.content, reply)
        except VoleryError as error:
            reply.fail(GraphError(str(error)))

    def _publish(self, topic: str, msgtype: str, cdr: bytes, *, externally: bool) -> None:
        if topic not in self._publishers:
            self.declare({topic: (msgtype, False)})
        message = decode_cdr(cdr, msgtype)
        if externally:
            self._publishers[topic].publish_external(message)
            return
        self._publishers[topic].publish(message)
        self._graph.deliver()

    def _call(self, service: str, srvtype: str, cdr: bytes) -> None:
        request = decode_cdr(cdr, f"{srvtype}_Request")
        with suppress(GraphError):  # a service of a node of the other machine
            self._graph.call_async(service, request, ServiceReply(_ignore, _ignore))
        self._graph.deliver()


def state_hash(fleet: Fleet, exchange: int) -> bytes:
    """Returns a hash of all positions, attitudes and velocities; empty in most exchanges."""
    if exchange % _HASH_PERIOD:
        return b""
    state = fleet.state
    digest = hashlib.blake2b(digest_size=8)
    for array in (state.position_map, state.attitude, state.velocity_map):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.digest()


def _command_of(item: Item) -> ClientCommand:
    client, kind, name, msgtype, content, latched, request = item
    return ClientCommand(
        client, kind, name, msgtype, records.content_of(kind, msgtype, content), latched, request
    )


def _ignore(_answer: object) -> None:
    """Discards the response: the node that called has it."""
