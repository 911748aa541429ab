"""The radio network of a run: each UAV is a station that relays topics to all others.

A message on a relayed topic `/uav1/NAME` is sent to all stations, each of which publishes it on
`/uav2/radio/NAME`. Nodes see the same topics as with a station of a real radio network
(`comms.station.radio_node`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from volery.comms.address_assignment import free_address
from volery.comms.addresses import ALL, FIRST_GROUND, Identity
from volery.comms.link_model import Delivery, Link, ideal_link
from volery.comms.local_network import LocalNetwork
from volery.comms.payloads import decode_named, encode_named
from volery.comms.protocol import StationFrame, StationFrameKind
from volery.comms.radio.channel import Jammer, RadioChannel
from volery.comms.server.settings import RouterSettings
from volery.core.errors import CommandError, CommsError
from volery.core.undo_steps import UndoSteps
from volery.graph.graph import Graph
from volery.graph.messages import Published
from volery.graph.topics import Publisher
from volery.scenario.radio import RelayedTopic

_TICK_S = 0.5
"""Less than the period at which stations must send, see `StationCore.tick`."""
_LOST = Delivery(lost=True)
_RULES = RouterSettings(grace_s=0.0, max_connections=FIRST_GROUND)
"""Without a grace time: a station that joins later receives no earlier messages."""


class Timers(Protocol):
    """Schedules callbacks at simulated times."""

    def at(self, time_ns: int, action: Callable[[], Any]) -> None:
        """Calls `action` once, at `time_ns`."""

    def every(
        self,
        period_s: float,
        callback: Callable[[], Any],
        *,
        wanted: Callable[[], bool] | None = None,
    ) -> None:
        """Calls `callback` each period, while `wanted` returns True."""


@dataclass
class _Member:
    """A UAV on the network: its relayed subscriptions, and publishers for the others' messages."""

    address: int
    incoming: dict[str, Publisher] = field(default_factory=dict)
    leave: UndoSteps = field(default_factory=UndoSteps)
    """Undoes what was made for it."""


class RadioNetwork:
    """Runs the stations of a run.

    link: None for ideal ones. A message too long for a frame is dropped and counted.
    """

    def __init__(
        self,
        graph: Graph,
        timers: Timers,
        topics: tuple[RelayedTopic, ...],
        link: RadioChannel | None = None,
    ) -> None:
        self._graph = graph
        self._timers = timers
        self._topics = topics
        self._radio = link
        self._inner: Link = link or ideal_link
        self._exchange = LocalNetwork(_RULES, self._decide, graph.now_ns())
        self._members: dict[str, _Member] = {}
        self._silent: Counter[int] = Counter()
        """Number of active faults of each station."""
        self._due_ns: int | None = None
        """Time of the next scheduled delivery, ns."""
        self.too_long = 0
        timers.every(_TICK_S, self._advance, wanted=lambda: bool(self._members))

    @property
    def link(self) -> RadioChannel | None:
        """The radio model; None: links are ideal."""
        return self._radio

    @property
    def statistics(self) -> Any:
        """Statistics of the server."""
        return self._exchange.statistics

    def addresses(self) -> dict[str, int]:
        """Returns linear ids by UAV."""
        return {name: member.address for name, member in self._members.items()}

    def join(self, name: str) -> Callable[[], None]:
        """Adds a radio to a UAV; returns the function that removes it.

        If a step fails, there is no radio, and the error is raised.
        """
        address = free_address(name, {m.address for m in self._members.values()})
        member = _Member(address)
        try:
            self._enter(name, member)
        except Exception:
            member.leave.run()
            raise
        return lambda: self._leave(member)

    def silence(self, name: str, by: int) -> None:
        """Adds (by = 1) or removes (by = -1) a fault that silences a UAV's radio."""
        address = self._address_of(name)
        self._silent[address] = max(self._silent[address] + by, 0)

    def check(self, name: str) -> None:
        """Raises CommandError if a UAV has no radio."""
        self._address_of(name)

    def check_jamming(self) -> None:
        """Raises `CommandError` if jammers disturb no link."""
        self._jammed_link()

    def jam(self, position_map: tuple[float, float, float], power_dbm: float, by: int) -> None:
        """Adds (by = 1) or removes (by = -1) a jammer at a position, m, with a power."""
        link, jammer = self._jammed_link(), Jammer(position_map, power_dbm)
        (link.jam if by > 0 else link.end_jamming)(jammer)

    def restore_all(self, name: str) -> None:
        """Removes the faults of a UAV's radio."""
        member = self._members.get(name)
        if member is not None:
            self._silent.pop(member.address, None)

    def reseed(self, seed: int) -> None:
        """Draws from other random streams."""
        if self._radio is not None:
            self._radio.reseed(seed)

    def get_state(self) -> dict[str, Any]:
        """Returns the state for a snapshot, without the list of members."""
        return {
            "exchange": self._exchange.get_state(),
            "link": None if self._radio is None else self._radio.get_state(),
            "silent": Counter(self._silent),
            "due_ns": self._due_ns,
            "too_long": self.too_long,
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state with the same members."""
        self._exchange.set_state(state["exchange"])
        if self._radio is not None:
            self._radio.set_state(state["link"])
        self._silent = Counter(state["silent"])
        self._due_ns = state["due_ns"]
        self.too_long = state["too_long"]

    # ---------------------------------------------------------------------------------- internals

    def _enter(self, name: str, member: _Member) -> None:
        leave, exchange, graph = member.leave, self._exchange, self._graph
        exchange.join(Identity.of(member.address), graph.now_ns())
        leave.add(lambda: exchange.leave(member.address, graph.now_ns()))
        self._members[name] = member
        leave.add(lambda: self._forget(name, member))
        for topic in self._topics:
            publisher = graph.advertise(f"/{name}/radio/{topic.name}", topic.type)
            leave.add(publisher.cancel)
            member.incoming[topic.name] = publisher
            send = self._sender(name, topic)
            leave.add(graph.subscribe(f"/{name}/{topic.name}", send, topic.type).cancel)

    def _sender(self, name: str, topic: RelayedTopic) -> Callable[[Published], None]:
        def send(published: Published) -> None:
            now_ns = self._graph.now_ns()
            station = self._exchange.station(self._members[name].address)
            try:
                payload = encode_named(topic.name, topic.type, published.message)
                station.send(StationFrameKind.SENSING, ALL, payload, now_ns)
            except CommsError:
                self.too_long += 1
                return
            self._advance()

        return send

    def _advance(self) -> None:
        """Delivers what is due, and schedules the next delivery."""
        now_ns = self._graph.now_ns()
        for address, frame in self._exchange.advance(now_ns):
            self._receive(address, frame)
        due_ns = self._exchange.next_due_ns
        if self._due_ns is not None and self._due_ns <= now_ns:
            self._due_ns = None
        if due_ns is not None and (self._due_ns is None or due_ns < self._due_ns):
            self._due_ns = due_ns
            self._timers.at(due_ns, self._advance)

    def _receive(self, address: int, frame: StationFrame) -> None:
        named = decode_named(frame.payload)
        for member in self._members.values():
            if member.address == address and named.name in member.incoming:
                member.incoming[named.name].publish(named.message)

    def _decide(self, time_ns: int, source: int, destination: int, frame: StationFrame) -> Delivery:
        if self._silent[source] > 0 or self._silent[destination] > 0:
            return _LOST
        return self._inner(time_ns, source, destination, frame)

    def _leave(self, member: _Member) -> None:
        errors = member.leave.run()
        if errors:
            raise errors[0]

    def _forget(self, name: str, member: _Member) -> None:
        self._members.pop(name, None)
        self._silent.pop(member.address, None)

    def _jammed_link(self) -> RadioChannel:
        if self._radio is None:
            raise CommandError('radio links = "ideal" know no noise that a jammer could raise')
        return self._radio

    def _address_of(self, name: str) -> int:
        if name not in self._members:
            known = ", ".join(self._members) or "none"
            raise CommandError(f"{name} has no radio; with one: {known}")
        return self._members[name].address
