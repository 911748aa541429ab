"""Router and stations in one process, with the caller's clock: a run's, or a test's.

    network = LocalNetwork(RouterSettings(), link=radio)
    one, other = network.join(Identity(0, 0)), network.join(Identity(0, 1))
    one.send(StationFrameKind.SENSING, other.address, b"...", now_ns)
    for address, frame in network.advance(now_ns): ...

The module draws no random numbers and reads no clock: the same calls give the same messages.
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
    """Connects stations to a router within the process.

    settings, link: as in `Router`. now_ns: the clock at the start.
    """

    def __init__(
        self, settings: RouterSettings | None = None, link: Link = ideal_link, now_ns: int = 0
    ) -> None:
        self._settings = settings or RouterSettings()
        self._link = link
        self._router = Router(self._settings, now_ns, _BOOT, self._decide)
        self._stations: dict[int, StationCore] = {}
        """Stations by connection."""
        self._joined = 0
        """Number of stations so far; each gets a session of its own, also if it replaces another
        one.
        """

    @property
    def statistics(self) -> Statistics:
        """Statistics of the router."""
        return self._router.statistics

    def join(self, identity: Identity, now_ns: int = 0) -> StationCore:
        """Returns a new station. Raises CommsError if there are too many."""
        core = StationCore(
            identity,
            self._joined + 1,
            token=self._settings.token,
            group_size=self._settings.group_size,
        )
        connection = self._router.connect(now_ns)
        if connection is None:
            raise CommsError(f"no more than {self._settings.max_connections} stations can join")
        self._joined += 1
        self._stations[connection] = core
        core.connected(now_ns)
        self._pass(now_ns)
        return core

    def leave(self, address: int, now_ns: int) -> None:
        """Removes a station. Raises CommsError if the address is unknown."""
        connection = self._connection_of(address)
        del self._stations[connection]
        self._router.forget(connection, now_ns)

    def station(self, address: int) -> StationCore:
        """Returns the station with an address. Raises CommsError if it is unknown."""
        return self._stations[self._connection_of(address)]

    @property
    def next_due_ns(self) -> int | None:
        """Time at which the next delayed message is due, ns; None: there is none."""
        return self._router.next_due_ns

    def get_state(self) -> Any:
        """Returns the state of router and stations; the link saves its own."""
        return self._copied((self._router, self._stations, self._joined))

    def set_state(self, state: Any) -> None:
        """Restores a saved state; it creates new stations: get them by `station`."""
        self._router, self._stations, self._joined = self._copied(state)

    def _copied(self, parts: Any) -> Any:
        return copy.deepcopy(parts, {id(self): self})  # the router calls it for the link

    def _decide(self, time_ns: int, source: int, destination: int, frame: StationFrame) -> Delivery:
        return self._link(time_ns, source, destination, frame)

    def _connection_of(self, address: int) -> int:
        for connection, core in self._stations.items():
            if core.address == address:
                return connection
        raise CommsError(f"there is no station {address}")

    def advance(self, now_ns: int) -> list[tuple[int, StationFrame]]:
        """Delivers what is due; returns receivers and frames in a fixed order."""
        for core in self._stations.values():
            core.tick(now_ns)
        self._router.tick(now_ns)
        return self._pass(now_ns)

    def _pass(self, now_ns: int) -> list[tuple[int, StationFrame]]:
        """Transfers bytes in both directions until none are left."""
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
