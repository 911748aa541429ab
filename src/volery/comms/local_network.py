"""Router and stations in one process, under whatever clock the caller has: a run's, or a test's.

    exchange = Exchange(RouterSettings(), link=radio)
    one, other = exchange.join(Identity(0, 0)), exchange.join(Identity(0, 1))
    one.send(Kind.SENSING, other.address, b"...", now_ns)
    for address, frame in exchange.advance(now_ns): ...

Nothing here draws numbers or reads a clock: the same calls give the same messages.
"""

from __future__ import annotations

import copy
from typing import Any

from volery.comms.addresses import Identity
from volery.comms.link_model import Delivery, Link, ideal_link
from volery.comms.protocol import StationFrame
from volery.comms.server.router import Router
from volery.comms.server.settings import RouterSettings
from volery.comms.server.statistics import Statistics
from volery.comms.station.core import StationCore
from volery.core.errors import CommsError

_BOOT = 1


class LocalNetwork:
    """Stations joined by a router, without bytes ever leaving the process.

    settings, link: as of `Router`. now_ns: the clock at the start.
    """

    def __init__(
        self, settings: RouterSettings | None = None, link: Link = ideal_link, now_ns: int = 0
    ) -> None:
        self._settings = settings or RouterSettings()
        self._link = link
        self._router = Router(self._settings, now_ns, _BOOT, self._decide)
        self._stations: dict[int, StationCore] = {}
        """By connection."""
        self._joined = 0
        """Stations so far: each is a session of its own, also where it follows another one."""

    @property
    def statistics(self) -> Statistics:
        """What the router has counted."""
        return self._router.statistics

    def join(self, identity: Identity, now_ns: int = 0) -> StationCore:
        """A new station. `CommsError` where there is no room for it."""
        core = StationCore(
            identity,
            self._joined + 1,
            token=self._settings.token,
            planes_per_batch=self._settings.planes_per_batch,
        )
        connection = self._router.connect(now_ns)
        if connection is None:
            raise CommsError(f"{self._settings.most_connections} stations are the most")
        self._joined += 1
        self._stations[connection] = core
        core.connected(now_ns)
        self._pass(now_ns)
        return core

    def leave(self, address: int, now_ns: int) -> None:
        """End a station for good. `CommsError` where there is none with this address."""
        connection = self._connection_of(address)
        del self._stations[connection]
        self._router.forget(connection, now_ns)

    def station(self, address: int) -> StationCore:
        """The station with an address. `CommsError` where there is none."""
        return self._stations[self._connection_of(address)]

    @property
    def next_due_ns(self) -> int | None:
        """When something that is under way is due; None: nothing is."""
        return self._router.next_due_ns

    def get_state(self) -> Any:
        """Everything that changes, but for what the link keeps itself."""
        return self._copied((self._router, self._stations, self._joined))

    def set_state(self, state: Any) -> None:
        """Go back to a kept state; stations are others than before: ask `station` for them."""
        self._router, self._stations, self._joined = self._copied(state)

    def _copied(self, parts: Any) -> Any:
        return copy.deepcopy(parts, {id(self): self})  # whom the router asks for the link

    def _decide(self, time_ns: int, source: int, destination: int, frame: StationFrame) -> Delivery:
        return self._link(time_ns, source, destination, frame)

    def _connection_of(self, address: int) -> int:
        for connection, core in self._stations.items():
            if core.address == address:
                return connection
        raise CommsError(f"there is no station {address}")

    def advance(self, now_ns: int) -> list[tuple[int, StationFrame]]:
        """Pass on what is due: stations that get something, and what, in a fixed order."""
        for core in self._stations.values():
            core.tick(now_ns)
        self._router.tick(now_ns)
        return self._pass(now_ns)

    def _pass(self, now_ns: int) -> list[tuple[int, StationFrame]]:
        """Carry bytes to and fro until nobody has anything to say."""
        came: list[tuple[int, StationFrame]] = []
        moved = True
        while moved:
            moved = False
            for connection, core in self._stations.items():
                if data := core.take():
                    self._router.receive(connection, data, now_ns)
                    moved = True
            for connection in self._router.take_woken():
                core = self._stations[connection]
                while data := self._router.take(connection, now_ns):
                    came += [(core.address, frame) for frame in core.feed(data, now_ns)]
                    core.acknowledge(now_ns)
                    moved = True
        return came
