"""The environment's side of the sensor link: listens, and sends frames to all clients.

    bridges.open(SensorLink(port=10100, image_port=10101))

Every client receives the frames of all sensors of all UAVs, and may send poses. Images have a port
of their own, so that scans do not wait for them. Form of the frames:
`volery.bridges.sensor_link.wire`.
"""

from __future__ import annotations

import asyncio
import errno
from dataclasses import dataclass

from volery.bridges.sensor_link.commands import SensorLinkCommands
from volery.bridges.sensor_link.outbox import SensorLinkOutbox
from volery.bridges.sensor_link.payloads import encode_notice
from volery.bridges.sensor_link.streams import (
    IMAGES,
    SENSORS,
    SensorStream,
    SensorStreams,
    period_from_hz,
)
from volery.bridges.sensor_link.wire import (
    VERSION,
    SensorLinkFrame,
    SensorLinkKind,
    SensorLinkParser,
    encode_frame,
)
from volery.core.errors import BridgeError
from volery.core.listener import Listener, open_listener
from volery.core.network_access import check_address, tend
from volery.core.preamble import Preamble
from volery.graph.session import Gateway

PORT = 10100
IMAGE_PORT = 10101
DEPTH = 20
"""Frames of one sensor that wait for a client: half a second of a scanner with 40 Hz."""
IMAGE_DEPTH = 1
MAX_CLIENTS = 64
"""Largest number of clients on each port."""

_COMMAND_LIMIT_BYTES = 4096
_WRITE_BUFFER_BYTES = 128 << 10


@dataclass(frozen=True)
class ClientInfo:
    """State of a client."""

    name: str
    received: int
    """Number of valid frames from it."""
    corrupt: int
    """Number of damaged frames from it."""
    dropped: int
    """Number of frames for which it was too slow."""
    waiting: int


class SensorLink:
    """A bridge for programs on the ROS side.

    Parameters
    ----------
    host
        Address to listen on.
    port, image_port
        Ports of sensors and of images; 0 takes a free port, see the attribute.
    anywhere
        Allows a `host` beyond loopback: the protocol carries no password.
    image_rate_hz
        Largest rate of each camera's images, Hz of simulated time; None: all.
    depth
        Queue depth of each sensor for a slow client; the oldest frames are dropped.

    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        *,
        image_port: int = IMAGE_PORT,
        anywhere: bool = False,
        image_rate_hz: float | None = None,
        depth: int = DEPTH,
    ) -> None:
        check_address(host, anywhere=anywhere, flag="anywhere=True or --allow-remote")
        self._host = host
        self._sensors = _Port(host, port, SENSORS, "sensor link", depth, 0)
        period_ns = period_from_hz(image_rate_hz)
        self._images = _Port(host, image_port, IMAGES, "sensor link images", IMAGE_DEPTH, period_ns)

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        return f"sensor link {self._host}:{self.port}, images {self.image_port}"

    @property
    def port(self) -> int:
        """Port of the sensors."""
        return self._sensors.port

    @property
    def image_port(self) -> int:
        """Port of the images."""
        return self._images.port

    @property
    def clients(self) -> tuple[ClientInfo, ...]:
        """All connected clients, those of images last."""
        return (*self._sensors.infos(), *self._images.infos())

    async def start(self, gateway: Gateway) -> None:
        """Starts listening. Raises `BridgeError` if a port is in use or the host is not local."""
        for port in (self._sensors, self._images):
            await port.open(gateway)

    async def stop(self) -> None:
        """Disconnects all clients."""
        for port in (self._sensors, self._images):
            await port.close()


class _Port:
    """One listening port and its clients."""

    def __init__(
        self,
        host: str,
        port: int,
        kinds: tuple[SensorLinkKind, ...],
        name: str,
        depth: int,
        period_ns: int,
    ) -> None:
        self.port = port
        self._host = host
        self._kinds = kinds
        self._name = name
        self._depth = depth
        self._period_ns = period_ns
        self._server: asyncio.Server | None = None
        self._listener: Listener | None = None
        self._clients: set[_Client] = set()
        self._streams: SensorStreams

    async def open(self, gateway: Gateway) -> None:
        loop = asyncio.get_running_loop()
        try:
            self._listener = open_listener(  # clients may only receive
                self._host, self.port, self._name, max_unproven=None
            )
            self._server = await loop.create_server(
                lambda: _Client(self, gateway, self._name), sock=self._listener
            )
        except (OSError, OverflowError) as error:
            raise _cannot_listen(self._host, self.port, error) from None
        self.port = self._server.sockets[0].getsockname()[1]
        name = f"{self._name} {self._host}:{self.port}"
        self._streams = SensorStreams(
            gateway, name, self._kinds, self._send, depth=self._depth, period_ns=self._period_ns
        )

    async def close(self) -> None:
        if self._server is not None:
            self._server.close()
            for client in tuple(self._clients):
                client.end()
            self._streams.close()
            self._server = None
        await asyncio.sleep(0)

    @property
    def takes_commands(self) -> bool:
        return self._kinds is SENSORS

    @property
    def depth(self) -> int:
        return self._depth

    def admit(self, client: _Client) -> bool:
        """Adds a client if there is room; returns whether there is."""
        if self._listener is None or self._server is None:
            return False
        if len(self._clients) >= MAX_CLIENTS and not self._listener.make_room_for(client.transport):
            return False
        self._clients.add(client)
        self._streams.open()
        return True

    def prove(self, client: _Client) -> None:
        """Records that a client has sent a valid frame."""
        if self._listener is not None:
            self._listener.prove(client.transport)

    def note_foreign_protocol(self, protocol: str) -> None:
        """Counts a client with another protocol."""
        if self._listener is not None:
            self._listener.note_foreign_protocol(protocol)

    def forget(self, client: _Client) -> None:
        self._clients.discard(client)
        if not self._clients:
            self._streams.close()

    def infos(self) -> list[ClientInfo]:
        return sorted((client.info for client in tuple(self._clients)), key=lambda info: info.name)

    def _send(self, stream: SensorStream, frame: bytes) -> None:
        for client in tuple(self._clients):
            client.put(stream, frame)


class _Client(asyncio.Protocol):
    """A connection: sends frames as fast as the client reads, receives commands."""

    def __init__(self, port: _Port, gateway: Gateway, name: str) -> None:
        self._port = port
        self._gateway = gateway
        self._name = name
        self._outbox = SensorLinkOutbox(port.depth)
        self._parser = SensorLinkParser(_COMMAND_LIMIT_BYTES)
        self._preamble = Preamble()
        self._paused = False
        self._notices = 0
        self._announced_version = self._announced_length = False
        self.transport: asyncio.Transport

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        address = transport.get_extra_info("peername") or ("?", 0)
        self._name = f"{self._name} {address[0]}:{address[1]}"
        tend(transport.get_extra_info("socket"))
        transport.set_write_buffer_limits(high=_WRITE_BUFFER_BYTES)
        if not self._port.admit(self):
            self._notify(f"there are {MAX_CLIENTS} clients already")
            transport.close()
            return
        self._session = self._gateway.open(self._name)
        self._commands = SensorLinkCommands(self._session)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002
        self._port.forget(self)
        session = getattr(self, "_session", None)
        if session is not None:
            session.close()

    def data_received(self, data: bytes) -> None:
        data = self._preamble.feed(data)
        if self._preamble.refused is not None:
            self._port.note_foreign_protocol(self._preamble.refused)
            self.transport.abort()
            return
        if self._port.takes_commands and not self.transport.is_closing():
            reading = self._session.reading
            reading.begin()
            frames = self._parser.feed(data)
            for frame in frames:
                self._take(frame)
            reading.end(len(frames), len(data))
            self._read_on()
            if self._parser.frames:
                self._port.prove(self)
            if self._parser.other_version is not None and not self._announced_version:
                self._announced_version = True
                self._notify(
                    f"this server uses version {VERSION}, not {self._parser.other_version}"
                )
            if self._parser.too_long is not None and not self._announced_length:
                self._announced_length = True
                self._notify(self._parser.too_long)

    def _read_on(self) -> None:
        """Reads from the client if its share of time allows it."""
        if self.transport.is_closing():
            return
        pause_s = self._session.reading.pause_s()
        if pause_s:
            self.transport.pause_reading()
            asyncio.get_running_loop().call_later(pause_s, self._read_on)
        else:
            self.transport.resume_reading()

    def pause_writing(self) -> None:
        self._paused = True

    def resume_writing(self) -> None:
        self._paused = False
        self._flush()

    def put(self, stream: SensorStream, frame: bytes) -> None:
        """Sends a frame, or queues it."""
        self._outbox.put(stream, frame)
        self._flush()

    def end(self) -> None:
        """Disconnects the client; unsent frames are dropped."""
        self.transport.abort()

    @property
    def info(self) -> ClientInfo:
        parser, outbox = self._parser, self._outbox
        return ClientInfo(self._name, parser.frames, parser.corrupt, outbox.dropped, len(outbox))

    def _take(self, frame: SensorLinkFrame) -> None:
        try:
            self._commands.take(frame)
        except BridgeError as error:
            self._notify(f"frame {frame.sequence} of UAV {frame.uav} is refused: {error}")

    def _notify(self, text: str) -> None:
        frame = encode_frame(SensorLinkKind.NOTICE, 0, self._notices, 0, encode_notice(text))
        self._notices += 1
        self._outbox.put(SensorLinkKind.NOTICE, frame)
        self._flush()

    def _flush(self) -> None:
        while not self._paused and not self.transport.is_closing():
            frame = self._outbox.take()
            if frame is None:
                return
            self.transport.write(frame)


def _cannot_listen(host: str, port: int, error: Exception) -> BridgeError:
    if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
        return BridgeError(
            f"sensor link: port {port} on {host} is in use: end the program that listens there "
            f"(`ss -ltnp 'sport = :{port}'` names it) or choose another port"
        )
    return BridgeError(f"sensor link: cannot listen on {host}:{port}: {error}")
