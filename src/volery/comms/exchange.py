"""Router and stations in one process, under whatever clock the caller has: a run's, or a test's.

    exchange = Exchange(RouterSettings(), link=radio)
    one, other = exchange.join(Identity(0, 0)), exchange.join(Identity(0, 1))
    one.send(Kind.SENSING, other.address, b"...", now_ns)
    for address, frame in exchange.advance(now_ns): ...

Nothing here draws numbers or reads a clock: the same calls give the same messages.
"""

from __future__ import annotations

from volery.comms.addresses import Identity
from volery.comms.link import Link, ideal_link
from volery.comms.protocol import Frame
from volery.comms.router import Router
from volery.comms.settings import RouterSettings
from volery.comms.station_core import StationCore
from volery.comms.statistics import Statistics
from volery.core.errors import CommsError

_SESSION = 1
_BOOT = 1


class Exchange:
    """Stations joined by a router, without bytes ever leaving the process.

    settings, link: as of `Router`. now_ns: the clock at the start.
    """

    def __init__(
        self, settings: RouterSettings | None = None, link: Link = ideal_link, now_ns: int = 0
    ) -> None:
        self._settings = settings or RouterSettings()
        self._router = Router(self._settings, now_ns, _BOOT, link)
        self._stations: dict[int, StationCore] = {}

    @property
    def statistics(self) -> Statistics:
        """What the router has counted."""
        return self._router.statistics

    def join(self, identity: Identity, now_ns: int = 0) -> StationCore:
        """A new station. `CommsError` where there is no room for it."""
        core = StationCore(
            identity,
            _SESSION,
            token=self._settings.token,
            planes_per_batch=self._settings.planes_per_batch,
        )
        connection = self._router.connect(now_ns)
        if connection is None:
            raise CommsError(f"{self._settings.most_connections} stations are the most")
        self._stations[connection] = core
        core.connected(now_ns)
        self._pass(now_ns)
        return core

    def advance(self, now_ns: int) -> list[tuple[int, Frame]]:
        """Pass on what is due: stations that get something, and what, in a fixed order."""
        for core in self._stations.values():
            core.tick(now_ns)
        self._router.tick(now_ns)
        return self._pass(now_ns)

    def _pass(self, now_ns: int) -> list[tuple[int, Frame]]:
        """Carry bytes to and fro until nobody has anything to say."""
        came: list[tuple[int, Frame]] = []
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
