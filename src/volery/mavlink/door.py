"""Doors for MAVLink: UDP as PX4's simulations have it, a TCP server, serial lines.

    doors.open(MavlinkUdp())             # a socket to 14540 + i and one to 14550 for each vehicle
    doors.open(MavlinkTcp(port=5760))    # all vehicles on each connection
    doors.open(MavlinkSerial("/dev/ttyUSB0", 57600))

UAVs without an autopilot are not there for them; see `volery.mavlink.outfit`.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import socket

from volery.core.errors import BridgeError
from volery.core.listening import LOOPBACK, check_address, tend
from volery.graph.session import Gateway
from volery.mavlink import ports
from volery.mavlink.codec import Parser, dialect
from volery.mavlink.fleet import Fleet, Sink
from volery.mavlink.framing import Framer
from volery.mavlink.serial_line import SerialLine
from volery.mavlink.streams import GROUND, ONBOARD

_UNSENT_BYTES = 1 << 18
"""What may wait for a TCP client who does not read; what comes then is lost for him."""
_MOST_CLIENTS = 32
"""Of the TCP server (modelling choice)."""


class MavlinkUdp:
    """Two links for each vehicle: to a companion computer and to a ground station.

    host: where those are. port: of the first companion computer, 14540; the others follow, and the
    vehicles' own ports keep their distance to it, so that several runs can stand side by side.
    Vehicles send from the beginning, to the stated ports and to whoever has spoken to them last.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = ports.ONBOARD_TO,
        *,
        ground_port: int | None = None,
        anywhere: bool = False,
    ) -> None:
        self._host = host
        self._shift = port - ports.ONBOARD_TO
        self._ground = ports.GROUND_TO + self._shift if ground_port is None else ground_port
        self._anywhere = anywhere
        self._links: dict[int, list[_UdpLink]] = {}
        self._fleet: Fleet | None = None
        self._looks: asyncio.Task[None] | None = None

    @property
    def name(self) -> str:
        """What it is and where."""
        onboard = ports.ONBOARD_TO + self._shift
        return f"MAVLink UDP {self._host}:{onboard} and following, {self._ground}"

    async def start(self, gateway: Gateway) -> None:
        """Begin to send. `BridgeError` where a port is taken."""
        dialect()
        check_address(self._host, anywhere=self._anywhere, flag="--allow-remote")
        self._fleet = Fleet(gateway, self.name, self._join, self._leave)
        self._fleet.look()
        self._looks = asyncio.create_task(self._fleet.keep_looking())

    async def stop(self) -> None:
        """Give all ports back."""
        if self._looks is not None:
            self._looks.cancel()
            await asyncio.gather(self._looks, return_exceptions=True)
        for system in tuple(self._links):
            self._leave(system)
        if self._fleet is not None:
            self._fleet.close()

    def _join(self, name: str, system: int) -> Sink:
        assert self._fleet is not None
        k = ports.number_of(system) + self._shift
        links = [
            (ports.ONBOARD_FROM + k, ports.ONBOARD_TO + k, ONBOARD),
            (ports.GROUND_FROM + k, self._ground, GROUND),
        ]
        opened: list[_UdpLink] = []
        try:
            for own, to, profile in links:
                opened.append(_UdpLink(self._fleet, system, profile, own, (self._host, to)))
        except BridgeError as error:
            for link in opened:
                link.close()
            raise BridgeError(f"{name}: {error}") from None
        self._links[system] = opened

        def sink(number: int, data: bytes) -> None:
            for link in opened:
                if number in (-1, link.number):
                    link.send(data)

        return sink

    def _leave(self, system: int) -> None:
        for link in self._links.pop(system, ()):
            link.close()


class _UdpLink:
    """One socket of one vehicle; its own port is the link's number."""

    def __init__(
        self, fleet: Fleet, system: int, profile: int, own: int, to: tuple[str, int]
    ) -> None:
        self.number = own
        self._fleet, self._system, self._profile = fleet, system, profile
        self._peers = [to]
        self._framer = Framer()
        family = socket.AF_INET6 if ":" in to[0] else socket.AF_INET
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((to[0] if to[0] in LOOPBACK else "", own))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise BridgeError(f"cannot listen on UDP port {own}: {_why(error)}") from None
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._socket, self._read)
        fleet.send(system, own, profile, b"")

    def send(self, data: bytes) -> None:
        """Send frames; where nobody listens they are lost, as by radio."""
        for peer in self._peers:
            for part in _pieces(data):
                with contextlib.suppress(OSError):
                    self._socket.sendto(part, peer)

    def close(self) -> None:
        """Give the port back."""
        self._loop.remove_reader(self._socket)
        self._socket.close()
        self._fleet.close_link(self._system, self.number)

    def _read(self) -> None:
        while True:
            try:
                data, peer = self._socket.recvfrom(65535)
            except (BlockingIOError, InterruptedError):
                return
            except OSError:  # what was sent found nobody
                continue
            if peer not in self._peers:  # the place agreed upon, and who spoke last
                self._peers = [self._peers[0], peer[:2]]
            frames = b"".join(frame.data for frame in self._framer.datagram(data))
            if frames:
                self._fleet.send(self._system, self.number, self._profile, frames)


class _Party:
    """One connection that carries all vehicles: TCP clients and serial lines."""

    def __init__(self, fleet: Fleet, number: int, profile: int) -> None:
        self.number = number
        self._fleet, self._profile = fleet, profile
        self._framer, self._parser = Framer(), Parser()
        self._systems: set[int] = set()

    def greet(self, system: int) -> None:
        """Have a vehicle send on it."""
        self._systems.add(system)
        self._fleet.send(system, self.number, self._profile, b"")

    def take(self, data: bytes) -> None:
        """Bring what came to the vehicles that it is for."""
        for frame in self._framer.feed(data):
            target = getattr(self._parser.decode(frame.data), "target_system", 0)
            chosen = self._systems if target == 0 else self._systems & {target}
            for system in sorted(chosen):
                self._fleet.send(system, self.number, self._profile, frame.data)

    def leave(self) -> None:
        """Tell the vehicles that it is there no more."""
        for system in self._systems:
            self._fleet.close_link(system, self.number)


class MavlinkTcp:
    """Serves all vehicles to each client, as a MAVLink router does.

    host, port: where it listens; port 0 takes a free one, and the attribute tells which.
    """

    def __init__(
        self, host: str = "127.0.0.1", port: int = ports.TCP, *, anywhere: bool = False
    ) -> None:
        self.host = host
        self.port = port
        self._anywhere = anywhere
        self._server: asyncio.Server | None = None
        self._fleet: Fleet | None = None
        self._looks: asyncio.Task[None] | None = None
        self._clients: dict[int, _TcpClient] = {}
        self._numbers = 0

    @property
    def name(self) -> str:
        """What it is and where."""
        return f"MAVLink TCP {self.host}:{self.port}"

    async def start(self, gateway: Gateway) -> None:
        """Begin to listen. `BridgeError` where that is not possible."""
        dialect()
        check_address(self.host, anywhere=self._anywhere, flag="--allow-remote")
        loop = asyncio.get_running_loop()
        try:
            self._server = await loop.create_server(
                lambda: _TcpClient(self), self.host, self.port, reuse_address=True
            )
        except (OSError, OverflowError) as error:
            raise BridgeError(f"cannot listen on {self.host}:{self.port}: {_why(error)}") from None
        self.port = self._server.sockets[0].getsockname()[1]
        self._fleet = Fleet(gateway, self.name, self._join, lambda _system: None)
        self._fleet.look()
        self._looks = asyncio.create_task(self._fleet.keep_looking())

    async def stop(self) -> None:
        """Let everybody go."""
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
        for client in self._clients.values():
            client.party.greet(system)
        return self._send

    def _send(self, number: int, data: bytes) -> None:
        for client in self._clients.values():
            if number in (-1, client.party.number):
                client.send(data)

    def _opened(self, client: _TcpClient) -> None:
        if self._fleet is None or len(self._clients) >= _MOST_CLIENTS:
            client.transport.abort()
            return
        self._numbers += 1
        number = (self.port + self._numbers) % 65535
        client.party = _Party(self._fleet, number, GROUND)
        self._clients[number] = client
        for system in self._fleet.systems:
            client.party.greet(system)

    def _closed(self, client: _TcpClient) -> None:
        for number, one in tuple(self._clients.items()):
            if one is client:
                del self._clients[number]
                client.party.leave()


class _TcpClient(asyncio.Protocol):
    """One connection."""

    transport: asyncio.Transport
    party: _Party

    def __init__(self, door: MavlinkTcp) -> None:
        self._door = door
        self._full = False

    def send(self, data: bytes) -> None:
        """Send frames, whole or not at all."""
        if not self._full:
            self.transport.write(data)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """As of asyncio."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        transport.set_write_buffer_limits(_UNSENT_BYTES)
        tend(transport.get_extra_info("socket"))
        self._door._opened(self)

    def data_received(self, data: bytes) -> None:
        """As of asyncio."""
        self.party.take(data)

    def pause_writing(self) -> None:
        """As of asyncio."""
        self._full = True

    def resume_writing(self) -> None:
        """As of asyncio."""
        self._full = False

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002
        """As of asyncio."""
        self._door._closed(self)


class MavlinkSerial:
    """All vehicles on one serial line: a radio, or a pseudo-terminal of another program.

    path: of the device. baud: its speed.
    """

    def __init__(self, path: str, baud: int = 57600) -> None:
        self._path, self._baud = path, baud
        self._fleet: Fleet | None = None
        self._looks: asyncio.Task[None] | None = None
        self._line: SerialLine | None = None
        self._party: _Party | None = None

    @property
    def name(self) -> str:
        """What it is and where."""
        return f"MAVLink serial {self._path} at {self._baud} baud"

    async def start(self, gateway: Gateway) -> None:
        """Open the line. `BridgeError` where that is not possible."""
        dialect()
        self._line = SerialLine(self._path, self._baud, self._take)
        self._fleet = Fleet(gateway, self.name, self._join, lambda _system: None)
        self._party = _Party(self._fleet, self._line.number, GROUND)
        self._fleet.look()
        self._looks = asyncio.create_task(self._fleet.keep_looking())

    async def stop(self) -> None:
        """Close the line."""
        if self._looks is not None:
            self._looks.cancel()
            await asyncio.gather(self._looks, return_exceptions=True)
        if self._party is not None:
            self._party.leave()
        if self._fleet is not None:
            self._fleet.close()
        if self._line is not None:
            self._line.close()

    def _join(self, _name: str, system: int) -> Sink:
        assert self._party is not None
        assert self._line is not None
        self._party.greet(system)
        line, own = self._line, self._party.number

        def sink(number: int, data: bytes) -> None:
            if number in (-1, own):
                line.send(data)

        return sink

    def _take(self, data: bytes) -> None:
        if self._party is not None:
            self._party.take(data)


def _why(error: Exception) -> str:
    taken = isinstance(error, OSError) and error.errno == errno.EADDRINUSE
    return "the port is taken" if taken else str(error)


_MOST_DATAGRAM = 1400
"""Bytes: below the MTU of Ethernet."""


def _pieces(data: bytes) -> list[bytes]:
    """Frames in datagrams, none of them cut."""
    if len(data) <= _MOST_DATAGRAM:
        return [data]
    pieces, start, at = [], 0, 0
    while at < len(data):
        length = data[at + 1] + 12 + (13 if data[at + 2] & 1 else 0)
        if at + length - start > _MOST_DATAGRAM and at > start:
            pieces.append(data[start:at])
            start = at
        at += length
    pieces.append(data[start:])
    return pieces
