"""A ROS-TCP endpoint: the server for Unity's ROS-TCP-Connector.

    bridges.open(RosTcpEndpoint(port=10000))       # messages of ROS 1
    bridges.open(RosTcpEndpoint(port=10001, generation="ros2"))

It serves any number of clients, each with its own session in the graph.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import socket
from collections.abc import Callable
from functools import partial

from volery.bridges.loop_waker import wake_of
from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.connection import RosTcpConnection, ServerEnd
from volery.bridges.ros_tcp.payloads import payloads_of
from volery.bridges.ros_tcp.session import FEATURES, EndpointSession
from volery.bridges.ros_tcp.wire import MAX_PAYLOAD_BYTES, Generation, RosTcpFrameParser
from volery.core.errors import BridgeError
from volery.core.listener import Listener, Opening, open_listener
from volery.core.network_access import check_address
from volery.core.pending_connections import look_at_binary
from volery.core.preamble import Preamble
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.session import Gateway
from volery.graph.subscription_queue import Wake

SILENCE_S = 15.0
"""Time of fifteen keepalives of Unity's Connector."""
_CHECKS_A_SILENCE = 4
_RETRY_S = 0.1


class RosTcpEndpoint:
    """A bridge that serves ROS-TCP clients.

    Parameters
    ----------
    host, port
        Listening address; port 0 takes a free port, see `port`.
    generation
        Encoding of payloads: "ros1" or "ros2". The handshake contains it.
    anywhere
        Allows a `host` beyond loopback: the protocol carries no password.
    max_payload_bytes
        A client that announces a longer payload is disconnected.
    depth
        Queue depth of each topic for a slow client; the oldest messages are dropped.
    silence_s
        Timeout of a client that has ever sent a keepalive.
    max_clients
        Largest number of clients.

    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 10000,
        *,
        generation: Generation = "ros1",
        anywhere: bool = False,
        max_payload_bytes: int = MAX_PAYLOAD_BYTES,
        depth: int = DEFAULT_DEPTH,
        silence_s: float = SILENCE_S,
        max_clients: int = 256,
    ) -> None:
        check_address(host, anywhere=anywhere, flag="anywhere=True or --allow-remote")
        payloads_of(generation)
        self.port = port
        self._host = host
        self._generation: Generation = generation
        self._max_payload_bytes = max_payload_bytes
        self._depth = depth
        self._silence_s = silence_s
        self._max_clients = max_clients
        self._listener: Listener | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._clients: set[_Client] = set()

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        return f"ROS-TCP {self._host}:{self.port} ({self._generation})"

    async def start(self, gateway: Gateway) -> None:
        """Starts listening. Raises `BridgeError` if the port is in use or the host is not local."""
        loop = asyncio.get_running_loop()
        if self._generation == "ros1":
            ros1_codec()  # slow to load: not when the first client connects
        greeting = ros_tcp.handshake(self._generation, FEATURES)
        self._listener = _listen(self._host, self.port, greeting)
        self.port = self._listener.getsockname()[1]
        self._tasks = [
            loop.create_task(self._accept(gateway, self._listener)),
            loop.create_task(self._watch()),
        ]

    async def stop(self) -> None:
        """Disconnects all clients."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._tasks = []
        for client in tuple(self._clients):
            client.stream.close("the bridge was closed")
        if self._listener is not None:
            self._listener.close()
            self._listener.close_connections()
            self._listener = None

    async def _accept(self, gateway: Gateway, listener: Listener) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                sock, address = await loop.sock_accept(listener)
            except OSError:  # the client is gone already
                await asyncio.sleep(_RETRY_S)
                continue
            if len(self._clients) >= self._max_clients:
                with contextlib.suppress(OSError), sock:
                    sock.send(ros_tcp.command("error", text="too many clients"))
                continue
            name = f"ros-tcp {address[0]}:{address[1]}"
            open_session = partial(EndpointSession, gateway, name, self._generation, self._depth)
            with contextlib.suppress(OSError):  # gone already
                parser = RosTcpFrameParser(self._max_payload_bytes)
                _Client(sock, parser, open_session, self._clients, listener)

    async def _watch(self) -> None:
        """Disconnects silent clients."""
        loop = asyncio.get_running_loop()
        while True:
            await asyncio.sleep(self._silence_s / _CHECKS_A_SILENCE)
            latest = loop.time() - self._silence_s
            for client in tuple(self._clients):
                if client.stream.parser.keepalives and client.stream.last_received_s < latest:
                    client.stream.close("it timed out")


class _Client:
    """A connection and its session."""

    def __init__(
        self,
        sock: socket.socket,
        parser: RosTcpFrameParser,
        open_session: Callable[[Wake], EndpointSession],
        everyone: set[_Client],
        listener: Listener,
    ) -> None:
        self._everyone = everyone
        self._session = session = open_session(wake_of(asyncio.get_running_loop(), self._flush))
        try:
            self.stream = RosTcpConnection(
                sock,
                parser,
                session.outbox,
                session.take,
                session.complain,
                self._closed,
                ServerEnd(
                    Preamble(), partial(listener.prove, sock), listener.note_foreign_protocol
                ),
                session.reading,
            )
        except OSError:
            session.close()
            sock.close()
            raise
        everyone.add(self)

    def _flush(self) -> None:
        self.stream.flush()

    def _closed(self, _reason: str) -> None:
        self._everyone.discard(self)
        self._session.close()


def _listen(host: str, port: int, greeting: bytes) -> Listener:
    opening = Opening(look_at_binary, greeting=greeting)
    try:
        return open_listener(host, port, "ROS-TCP", opening=opening)
    except (OSError, OverflowError) as error:
        if isinstance(error, OSError) and error.errno == errno.EADDRINUSE:
            raise BridgeError(
                f"ROS-TCP: port {port} on {host} is in use: end the program that listens there "
                f"(`ss -ltnp 'sport = :{port}'` names it) or choose another port"
            ) from None
        raise BridgeError(f"ROS-TCP: cannot listen on {host}:{port}: {error}") from None
