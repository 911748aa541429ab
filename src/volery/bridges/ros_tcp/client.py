"""Connects a program to the graph of a ROS-TCP endpoint: Volery's, or Unity's ROS-TCP-Endpoint.

    client = RosTcpClient("127.0.0.1", 10000, name="planner")
    queue = client.subscribe("/uav1/odom", "nav_msgs/msg/Odometry", wake=wake)
    client.advertise("/uav1/cmd_vel", "geometry_msgs/msg/Twist")
    client.publish("/uav1/cmd_vel", Twist(...))

The client has the methods of `graph.session.Session`. If the connection breaks, the client
reconnects and repeats its advertisements, subscriptions and services.
"""

from __future__ import annotations

import asyncio
import socket
from collections import deque
from typing import Any

from volery.bridges.loop_waker import wake_of
from volery.bridges.remote_client import RemoteClient
from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.client_outbox import ClientOutbox
from volery.bridges.ros_tcp.client_services import ClientServices
from volery.bridges.ros_tcp.client_topics import ClientTopics
from volery.bridges.ros_tcp.connect import FIRST_PAUSE_S, KEEPALIVE_S, LONGEST_PAUSE_S, dial
from volery.bridges.ros_tcp.connection import RosTcpConnection
from volery.bridges.ros_tcp.payloads import payloads_of
from volery.bridges.ros_tcp.wire import Generation, RosTcpFrame, RosTcpFrameParser, number_field
from volery.core.errors import BridgeError, GraphError, reason_of
from volery.graph.service_reply import ServiceReply
from volery.graph.session import SessionInfo

MOST_PROBLEMS = 100


class RosTcpClient(RemoteClient):
    """Connects one program to a remote graph. Any thread may call the methods.

    `close` sends queued messages before it disconnects.

    Parameters
    ----------
    host, port
        Address of the endpoint.
    name
        Name of the client, for messages.
    generation
        Generation of ROS of an endpoint without a handshake, as before 0.7.
    connect_timeout_s
        Timeout of the first connection; 0: do not wait, connect in the background.
    handshake_s
        Time after which an endpoint counts as one without a handshake.

    Raises
    ------
    BridgeError
        No server answers in time, or the server is not a ROS-TCP endpoint.

    """

    _PROTOCOL = "ROS-TCP"
    _SERVER = "endpoint"

    _topics: ClientTopics
    _services: ClientServices

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 10000,
        *,
        name: str = "volery",
        generation: Generation = "ros1",
        connect_timeout_s: float = 5.0,
        handshake_s: float = 2.0,
    ) -> None:
        if not 1 <= port <= 65535:
            raise BridgeError(f"ROS-TCP: port must be 1 to 65535, not {port}")
        payloads_of(generation)
        super().__init__(name, f"[{host}]:{port}" if ":" in host else f"{host}:{port}")
        self._address = (host, port)
        self._generation: Generation = generation
        self._handshake_s = handshake_s
        self._line = ClientOutbox(wake_of(self._loop, self._flush))
        self._topics = ClientTopics(self._line)
        self._services = ClientServices(self._line)
        self._body: tuple[str, int] | None = None
        self._stream: RosTcpConnection | None = None
        self._problems: deque[str] = deque(maxlen=MOST_PROBLEMS)
        self._start(connect_timeout_s)

    @property
    def problems(self) -> tuple[str, ...]:
        """Newest error reports of the endpoint, and errors of the connection."""
        return tuple(self._problems)

    @property
    def dropped(self) -> int:
        """Number of publications without a connection, or over too slow a connection."""
        return self._line.dropped

    @property
    def info(self) -> SessionInfo:
        """Current state of the client."""
        with self._line.lock:
            publishes, queues = self._topics.announced, self._topics.queues
        return SessionInfo(self.name, publishes, queues, self._services.offered)

    def topic_types(self) -> dict[str, str]:
        """Returns topics of the graph and their types, by name.

        Raises `GraphError` without an answer.
        """
        return self._ask(
            lambda found: self._topics.ask_list(
                ServiceReply(found.set_result, found.set_exception)
            ),
            f"the endpoint at {self._where} does not list its topics",
        )

    def _type_of(self, topic: str) -> str | None:
        return self.topic_types().get(topic)

    # ------------------------------------------------------------------------------- its thread

    def _leave(self) -> None:
        if self._stream is None:
            super()._leave()
        else:
            self._stream.finish()

    def _flush(self) -> None:
        if self._stream is not None:
            self._stream.flush()

    async def _keep_connected(self) -> None:
        pause_s = FIRST_PAUSE_S
        while True:
            before = self._connections
            try:
                await self._serve(await dial(*self._address))
            except (OSError, TimeoutError, UnicodeError) as error:  # or no such name exists
                self._why = reason_of(error)
            self._lose(f"the connection to {self._where} is broken")
            if self._closed:
                return
            pause_s = FIRST_PAUSE_S if self._connections > before else pause_s
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)

    async def _serve(self, sock: socket.socket) -> None:
        """Runs the protocol until the connection ends."""
        ended: asyncio.Future[None] = self._loop.create_future()
        reasons: list[str] = []

        def closed(reason: str) -> None:
            self._stream = None
            reasons.append(reason)
            if not ended.done():
                ended.set_result(None)

        def broken(reason: str) -> None:
            reasons.append(reason)
            self._problems.append(reason)

        self._body = None
        try:
            stream = RosTcpConnection(
                sock, RosTcpFrameParser(), self._line, self._take, broken, closed
            )
        except OSError:
            sock.close()
            raise
        self._stream = stream
        try:
            self._line.keep_alive()
            await self._attend(stream, ended)
        finally:
            stream.close(f"{self.name} is closed")
        self._why = reasons[0]

    async def _attend(self, stream: RosTcpConnection, ended: asyncio.Future[None]) -> None:
        """Sends keepalives until the connection ends."""
        latest_s = self._loop.time() + self._handshake_s
        while not ended.done():
            await asyncio.wait([ended], timeout=min(KEEPALIVE_S / 2.0, self._handshake_s))
            now_s = self._loop.time()
            if not self._line.open and now_s >= latest_s and not ended.done():
                self._begin(self._generation, frozenset())
            if now_s >= stream.last_sent_s + KEEPALIVE_S and not self._line.crowded:
                self._line.keep_alive()

    def _begin(self, generation: Generation, features: frozenset[str]) -> None:
        """Repeats all requests after the endpoint's generation is known."""
        with self._line.lock:
            self._line.begin(generation, features)
            self._topics.repeat_topics()
            self._services.repeat()
        self._joined()

    def _drop(self, why: str) -> None:
        self._line.lose()
        self._topics.lose(why)
        self._services.lose(why)

    # ------------------------------------------------------------------------------------- input

    def _take(self, frame: RosTcpFrame) -> None:
        """Handles a frame. Raises `BridgeError` for an invalid handshake."""
        body, self._body = self._body, None
        if frame.destination == "__handshake":
            fields = ros_tcp.read_fields(frame.payload)
            generation = ros_tcp.read_handshake(fields)
            if not self._line.open:
                self._begin(generation, ros_tcp.read_features(fields))
            return
        try:
            if frame.destination.startswith("__"):
                self._command(frame.destination, ros_tcp.read_fields(frame.payload))
            elif body is None:
                self._topics.take(frame)
            elif body[0] == "__request":
                self._services.take_request(body[1], frame)
            else:
                self._services.take_response(body[1], frame)
        except (BridgeError, GraphError) as error:
            self._problems.append(f"{frame.destination[:200]}: {error}")

    def _command(self, name: str, fields: dict[str, Any]) -> None:
        if name in ("__request", "__response"):
            self._body = name, number_field(fields, "srv_id")
        elif name == "__topic_list":
            self._topics.take_list(fields)
        elif name in ("__error", "__warn", "__log"):
            text = str(fields.get("text", ""))[:1000]
            self._problems.append(text)
            if name == "__error":
                self._services.on_error(text)
