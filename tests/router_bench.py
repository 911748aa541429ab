"""A communication server and stations, joined by hand under a clock of the test's own."""

from __future__ import annotations

from volery.comms.addresses import Identity
from volery.comms.protocol import StationFrameKind
from volery.comms.server.router import Router
from volery.comms.server.settings import RouterSettings
from volery.comms.station.core import StationCore

MS = 1_000_000
S = 1000 * MS


class Bench:
    """A router and stations whose connections a test makes and breaks."""

    def __init__(self, settings: RouterSettings | None = None, link=None, now_ns: int = 0) -> None:
        self.settings = settings or RouterSettings()
        self.link = {} if link is None else {"link": link}
        self.router = Router(self.settings, now_ns, 1, **self.link)
        self.now = now_ns
        self.cores: dict[int, StationCore] = {}
        self.connections: dict[int, int] = {}
        self.got: dict[int, list[bytes]] = {}

    def station(self, address: int, session: int = 1) -> StationCore:
        core = StationCore(Identity.of(address), session, token=self.settings.token)
        self.cores[address] = core
        self.got.setdefault(address, [])
        self.connect(address)
        return core

    def connect(self, address: int) -> None:
        connection = self.router.connect(self.now)
        assert connection is not None
        self.connections[address] = connection
        self.cores[address].connected(self.now)
        self.run()

    def cut(self, address: int) -> None:
        self.router.disconnect(self.connections.pop(address), self.now)
        self.cores[address].disconnected()

    def restart(self) -> None:
        """The server is killed and another one started."""
        for address in list(self.connections):
            self.cut(address)
        self.router = Router(self.settings, self.now, 2, **self.link)

    def run(self, passed_ns: int = 0, *, acknowledge: bool = True) -> None:
        """Let time pass, in steps of a second at most, and carry bytes until all is quiet."""
        while passed_ns > S:
            self.run(S, acknowledge=acknowledge)
            passed_ns -= S
        self.now += passed_ns
        self.router.tick(self.now)
        for _ in range(100):
            quiet = True
            for address, connection in list(self.connections.items()):
                core = self.cores[address]
                if acknowledge:
                    core.tick(self.now)
                if data := core.take():
                    self.router.receive(connection, data, self.now)
                    quiet = False
            woken = self.router.take_woken()
            for address, connection in list(self.connections.items()):
                if connection not in woken:
                    continue
                while data := self.router.take(connection, self.now):
                    new = self.cores[address].feed(data, self.now)
                    self.got[address] += [frame.payload for frame in new]
                    quiet = False
                if self.router.closing(connection):
                    self.cut(address)
            if quiet:
                return
        raise AssertionError("they never stop talking")

    def send(
        self,
        source: int,
        destination: int,
        text: str,
        kind: StationFrameKind = StationFrameKind.SENSING,
    ) -> int:
        return self.cores[source].send(kind, destination, text.encode(), self.now)
