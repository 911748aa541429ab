"""Serves MAVLink over TCP: every connection carries all vehicles, like a MAVLink router."""

from __future__ import annotations

import asyncio

from volery.core.errors import BridgeError
from volery.core.listener import Listener, open_listener
from volery.core.network_access import check_address, tend, write_while_open
from volery.core.preamble import Preamble
from volery.graph.session import Gateway
from volery.mavlink.autopilot.messages.streams import GROUND
from volery.mavlink.codec import dialect
from volery.mavlink.links import ports
from volery.mavlink.links.connection import MavlinkConnection, why_not
from volery.mavlink.links.rate_limits import RateLimits
from volery.mavlink.links.vehicle_registry import Sink, VehicleRegistry

_UNSENT_BYTES = 1 << 18
"""Largest number of unsent bytes for a TCP client that does not read; later frames are dropped."""
_MAX_CLIENTS = 32
"""Clients of the TCP server (modelling choice). Beyond, the oldest without a valid frame ends."""
_BUFFER_BYTES = 2048
"""Bytes read at once, so that no client delays others or the simulation for long."""


class MavlinkTcp:
    """Serves all vehicles to each client, as a MAVLink router does.

    host, port: listening address; port 0 takes a free port, which the attribute then holds.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = ports.TCP,
        *,
        anywhere: bool = False,
        key: bytes | None = None,
    ) -> None:
        self._key = key
        self.host = host
        self.port = port
        self._anywhere = anywhere
        self._server: asyncio.Server | None = None
        self._listener: Listener | None = None
        self._intake = RateLimits()
        self._fleet: VehicleRegistry | None = None
        self._looks: asyncio.Task[None] | None = None
        self._clients: dict[int, _TcpClient] = {}
        self._numbers = 0

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        return f"MAVLink TCP {self.host}:{self.port}"

    async def start(self, gateway: Gateway) -> None:
        """Starts listening. Raises `BridgeError` if that fails."""
        dialect()
        check_address(self.host, anywhere=self._anywhere, flag="--allow-remote")
        loop = asyncio.get_running_loop()
        try:
            self._listener = open_listener(
                self.host,
                self.port,
                "MAVLink TCP",
                max_connections=_MAX_CLIENTS,
                max_unproven=None,  # a program may only receive
            )
            self._server = await loop.create_server(lambda: _TcpClient(self), sock=self._listener)
        except (OSError, OverflowError) as error:
            raise BridgeError(
                f"cannot listen on {self.host}:{self.port}: {why_not(error)}"
            ) from None
        self.port = self._server.sockets[0].getsockname()[1]
        self._fleet = VehicleRegistry(gateway, self.name, self._join, lambda _system: None)
        self._fleet.look()
        self._looks = asyncio.create_task(self._fleet.look_periodically())

    async def stop(self) -> None:
        """Ends all connections."""
        if self._looks is not None:
            self._looks.cancel()
            await asyncio.gather(self._looks, return_exceptions=True)
        if self._server is not None:
            self._server.close()
        for client in tuple(self._clients.values()):
            client.transport.abort()
        await asyncio.sleep(0)  # their callbacks
        if self._fleet is not None:
            self._fleet.close()

    def _join(self, _name: str, system: int) -> Sink:
        if self._fleet is not None:
            self._intake.fit(len(self._fleet.systems))
        for client in self._clients.values():
            client.connection.greet(system)
        return self._send

    def _send(self, number: int, data: bytes) -> None:
        for client in self._clients.values():
            if number in (-1, client.connection.number):
                client.send(data)

    def _opened(self, client: _TcpClient) -> None:
        if self._fleet is None:
            client.transport.abort()
            return
        self._numbers += 1
        number = (self.port + self._numbers) % 65535
        client.connection = MavlinkConnection(
            self._fleet, number, GROUND, self._key, self._intake.account()
        )
        self._clients[number] = client
        for system in self._fleet.systems:
            client.connection.greet(system)

    def _prove(self, client: _TcpClient) -> None:
        if self._listener is not None:
            self._listener.prove(client.transport)

    def _end_foreign(self, client: _TcpClient) -> None:
        if self._listener is not None:
            self._listener.note_foreign_protocol(client.preamble.refused or "")
        client.transport.abort()

    def _closed(self, client: _TcpClient) -> None:
        for number, one in tuple(self._clients.items()):
            if one is client:
                del self._clients[number]
                client.connection.leave()


class _TcpClient(asyncio.BufferedProtocol):
    """One TCP client."""

    transport: asyncio.Transport
    connection: MavlinkConnection

    def __init__(self, bridge: MavlinkTcp) -> None:
        self._bridge = bridge
        self._full = False
        self._buffer = bytearray(_BUFFER_BYTES)
        self.preamble = Preamble()
        self._proven = False
        self._pause: asyncio.TimerHandle | None = None

    def send(self, data: bytes) -> None:
        """Sends frames, whole or not at all."""
        if not self._full:
            write_while_open(self.transport, self.connection.sign(data))

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Implements asyncio's method."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        transport.set_write_buffer_limits(_UNSENT_BYTES)
        tend(transport.get_extra_info("socket"))
        self._bridge._opened(self)

    def get_buffer(self, sizehint: int) -> bytearray:  # noqa: ARG002
        """Implements asyncio's method."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Implements asyncio's method."""
        data = self.preamble.feed(bytes(self._buffer[:nbytes]))
        if self.preamble.refused is not None:
            self._bridge._end_foreign(self)
            return
        pause_s = self.connection.take(data)
        if not self._proven and self.connection.has_received:
            self._proven = True
            self._bridge._prove(self)
        if pause_s > 0.0 and not self.transport.is_closing():
            self.transport.pause_reading()
            self._read_after(pause_s)

    def _read_after(self, pause_s: float) -> None:
        self._pause = asyncio.get_running_loop().call_later(pause_s, self._read_again)

    def _read_again(self) -> None:
        pause_s = self.connection.may_read()
        if pause_s > 0.0:
            self._read_after(pause_s)
        elif not self.transport.is_closing():
            self.transport.resume_reading()

    def pause_writing(self) -> None:
        """Implements asyncio's method."""
        self._full = True

    def resume_writing(self) -> None:
        """Implements asyncio's method."""
        self._full = False

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002
        """Implements asyncio's method."""
        if self._pause is not None:
            self._pause.cancel()
        self._bridge._closed(self)
