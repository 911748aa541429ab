"""The communication server on TCP: sockets and the wall clock around `Router`.

    server = CommsServer(port=10200)
    await server.start()
    ...
    await server.stop()

All code runs in the callbacks of one asyncio loop. A station that does not read fills its own queue
and delays no other.
"""

from __future__ import annotations

import asyncio
import errno
import secrets
import time

from volery.comms.server.router import Router
from volery.comms.server.settings import RouterSettings
from volery.comms.server.statistics import Statistics
from volery.core.errors import CommsError
from volery.core.listener import Listener, open_listener
from volery.core.network_access import check_address, check_token, tend, write_while_open
from volery.core.preamble import Preamble
from volery.core.token_attempts import TokenAttempts

PORT = 10200
_TICK_S = 0.05
_UNSENT_BYTES = 128 << 10
"""Max unsent bytes of a connection; more messages wait in the station's queue."""
_EARLY_BYTES = 4096
"""Max bytes before the token check; a HELLO fits."""
_FAREWELL_S = 1.0
"""Time for which a closing connection may read its refusal, s."""


class CommsServer:
    """Serves stations on a TCP port.

    Parameters
    ----------
    settings
        The limits, and the token that stations must send.
    host, port
        Address to listen on; port 0 picks a free one, which the attribute then holds.
    anywhere
        Allows a `host` beyond loopback, which also needs a token.

    """

    def __init__(
        self,
        settings: RouterSettings | None = None,
        host: str = "127.0.0.1",
        port: int = PORT,
        *,
        anywhere: bool = False,
    ) -> None:
        self.host = host
        self.port = port
        self._settings = settings or RouterSettings()
        self._anywhere = anywhere
        self._server: asyncio.Server | None = None
        self._ticks: asyncio.TimerHandle | None = None
        self._listener: Listener | None = None
        self._attempts: TokenAttempts | None = None
        self._checks: set[asyncio.Task[None]] = set()
        self._links: dict[int, _StationLink] = {}
        self._sends = False

    @property
    def name(self) -> str:
        """Name and address of the server."""
        return f"communication server {self.host}:{self.port}"

    @property
    def statistics(self) -> Statistics:
        """Statistics since the start."""
        return self.router.statistics

    async def start(self) -> None:
        """Starts to listen.

        Raises
        ------
        BridgeError
            The address is beyond loopback without permission and token.
        CommsError
            The address is in use or not this machine's.

        """
        check_address(self.host, anywhere=self._anywhere, flag="--allow-remote and --token")
        check_token(self.host, self._settings.token)
        self.router = Router(self._settings, time.monotonic_ns(), secrets.randbits(32))
        self._loop = asyncio.get_running_loop()
        try:
            self._listener = open_listener(self.host, self.port, "communication server")
            self._server = await self._loop.create_server(
                lambda: _StationLink(self), sock=self._listener
            )
        except (OSError, OverflowError) as error:
            taken = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
            why = "the port is taken" if taken else str(error)
            raise CommsError(f"cannot listen on {self.host}:{self.port}: {why}") from None
        self.port = self._server.sockets[0].getsockname()[1]
        self._attempts = None if self._settings.token is None else TokenAttempts()
        self._tick()

    async def stop(self) -> None:
        """Closes all connections."""
        if self._ticks is not None:
            self._ticks.cancel()
        if self._server is not None:
            self._server.close()
        for check in tuple(self._checks):
            check.cancel()
        for link in list(self._links.values()):
            link.transport.abort()
        await asyncio.sleep(0)  # run their callbacks

    def _tick(self) -> None:
        self.router.tick(time.monotonic_ns())
        self._send_woken()
        self._ticks = self._loop.call_later(_TICK_S, self._tick)

    # ---------------------------------------------------------------------------- for connections

    def _opened(self, link: _StationLink) -> None:
        number = self.router.connect(time.monotonic_ns())
        if number is None:
            link.transport.abort()
            return
        link.number = number
        self._links[number] = link

    def _came(self, link: _StationLink, data: bytes) -> None:
        if self._attempts is None or link.proven:
            self._receive(link, data)
            return
        link.early += data
        if len(link.early) > _EARLY_BYTES:
            link.transport.pause_reading()
        if not link.waits:
            link.waits = True
            self.router.hold(link.number, is_held=True)
            check = self._loop.create_task(self._check(link, self._attempts))
            self._checks.add(check)
            check.add_done_callback(self._checks.discard)

    async def _check(self, link: _StationLink, attempts: TokenAttempts) -> None:
        """Passes a station's early data to the router, one token check at a time."""
        async with attempts.turn(link.address):
            self.router.hold(link.number, is_held=False)
            data, link.early, link.waits = link.early, b"", False
            if link.transport.is_closing():
                return
            self._receive(link, data)
            link.transport.resume_reading()
            if self.router.closing(link.number):
                await attempts.penalize()

    def _receive(self, link: _StationLink, data: bytes) -> None:
        self.router.receive(link.number, data, time.monotonic_ns())
        if not link.proven and self._listener is not None:
            link.proven = self.router.has_greeted(link.number)
            if link.proven:
                self._listener.prove(link.transport)
        if not self._sends:  # once for all data of this turn of the loop
            self._sends = True
            self._loop.call_soon(self._send_woken)

    def _end_foreign(self, link: _StationLink, protocol: str) -> None:
        if self._listener is not None:
            self._listener.note_foreign_protocol(protocol)
        link.transport.abort()

    def _closed(self, link: _StationLink) -> None:
        self._links.pop(link.number, None)
        self.router.disconnect(link.number, time.monotonic_ns())

    def _send_woken(self) -> None:
        self._sends = False
        for number in self.router.take_woken():
            link = self._links.get(number)
            if link is not None:
                self._send(link)

    def _send(self, link: _StationLink) -> None:
        now_ns = time.monotonic_ns()
        while not link.paused and (data := self.router.take(link.number, now_ns)):
            write_while_open(link.transport, data)
        if self.router.closing(link.number):
            self._closed(link)
            link.transport.close()
            self._loop.call_later(_FAREWELL_S, link.transport.abort)


class _StationLink(asyncio.Protocol):
    """One connection."""

    transport: asyncio.Transport

    def __init__(self, server: CommsServer) -> None:
        self._server = server
        self.number = 0
        self.paused = False
        self.proven = False
        """Whether the station is known to the router."""
        self.waits = False
        """Whether its data waits for the token check."""
        self.early = b""
        self.address = "?"
        self._preamble = Preamble()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Implements asyncio.Protocol."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        transport.set_write_buffer_limits(_UNSENT_BYTES)
        tend(transport.get_extra_info("socket"))
        self.address = str((transport.get_extra_info("peername") or ("?",))[0])
        self._server._opened(self)

    def data_received(self, data: bytes) -> None:
        """Implements asyncio.Protocol."""
        data = self._preamble.feed(data)
        if self._preamble.refused is not None:
            self._server._end_foreign(self, self._preamble.refused)
        elif data:
            self._server._came(self, data)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002
        """Implements asyncio.Protocol."""
        self._server._closed(self)

    def pause_writing(self) -> None:
        """Implements asyncio.Protocol."""
        self.paused = True

    def resume_writing(self) -> None:
        """Implements asyncio.Protocol."""
        self.paused = False
        self._server._send(self)
