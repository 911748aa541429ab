"""Connects a program to the graph of a rosbridge server: Volery's, or a real robot's.

    client = RosbridgeClient("ws://127.0.0.1:9090", name="planner")
    queue = client.subscribe("/uav1/odom", "nav_msgs/msg/Odometry", wake=wake)
    client.advertise("/uav1/cmd_vel", "geometry_msgs/msg/Twist")
    client.publish("/uav1/cmd_vel", Twist(...))

The client has the methods of `graph.session.Session`. If the connection breaks, the client
reconnects and repeats its advertisements, subscriptions and services.
"""

from __future__ import annotations

import asyncio
import itertools
import time
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidURI, WebSocketException
from websockets.uri import parse_uri

from volery.bridges.loop_waker import wake_of
from volery.bridges.remote_client import RemoteClient
from volery.bridges.rosbridge.client_state import ClientState
from volery.bridges.rosbridge.message_encoder import Generation
from volery.bridges.rosbridge.wire import CBOR_PROTOCOL, MOST_MESSAGE_BYTES, Frame
from volery.core.errors import BridgeError, reason_of
from volery.graph.session import SessionInfo

_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 5.0
_KEEPALIVE_S = 20.0
_UNIX, _LOCAL = "unix://", "ws://localhost/"


class RosbridgeClient(RemoteClient):
    """Connects one program to a remote graph. Any thread may call the methods.

    Parameters
    ----------
    url
        `ws://host:port/path` or `wss://...`; `unix://` and the path of a Unix-domain socket.
    name
        Name of the client, for messages.
    token
        Sent to the server, if given.
    generation
        Spelling of types and times of the server; Volery's accepts both.
    connect_timeout_s
        Timeout of the first connection; 0: do not wait, connect in the background.

    Raises
    ------
    BridgeError
        The URL is invalid, or no server answers in time.

    """

    _PROTOCOL = "rosbridge"
    _SERVER = "server"

    def __init__(
        self,
        url: str,
        *,
        name: str = "volery",
        token: str | None = None,
        connect_timeout_s: float = 5.0,
        max_message_bytes: int = MOST_MESSAGE_BYTES,
        generation: Generation = "ros2",
    ) -> None:
        self._socket = url.removeprefix(_UNIX) if url.startswith(_UNIX) else None
        if self._socket is None and not url.startswith(("ws://", "wss://")):
            raise _no_address(url)
        try:
            parse_uri(_LOCAL if self._socket else url)
        except (InvalidURI, ValueError):
            raise _no_address(url) from None
        super().__init__(name, url)
        self.url = url
        self._most_bytes = max_message_bytes
        self._wanted = asyncio.Event()
        self._state = ClientState(token, wake_of(self._loop, self._wanted.set), generation)
        self._topics = self._services = self._state
        self._start(connect_timeout_s)

    @property
    def problems(self) -> tuple[str, ...]:
        """Newest error reports of the server."""
        return tuple(self._state.problems)

    @property
    def dropped(self) -> int:
        """Number of publications without a connection, or over too slow a connection."""
        return self._state.dropped

    @property
    def info(self) -> SessionInfo:
        """Current state of the client."""
        return self._state.info(self.name)

    def _type_of(self, topic: str) -> str:
        return self._ask(
            lambda found: self._state.ask_rosapi("topic_type", {"topic": topic}, found),
            f"rosapi at {self.url} does not answer",
        )

    # ------------------------------------------------------------------------------- its thread

    def _drop(self, why: str) -> None:
        self._state.lose(why)

    async def _keep_connected(self) -> None:
        pause_s = _FIRST_PAUSE_S
        while True:
            began_s = time.monotonic()
            try:
                await self._connect_once()
                self._why = "the server has closed the connection"
            except (WebSocketException, OSError, ValueError) as error:  # or no such address exists
                self._why = reason_of(error)
            finally:
                self._lose(f"the connection to {self.url} is broken")
            lasted = time.monotonic() - began_s > _LONGEST_PAUSE_S
            pause_s = _FIRST_PAUSE_S if lasted else min(_LONGEST_PAUSE_S, 2 * pause_s)
            await asyncio.sleep(pause_s)

    async def _connect_once(self) -> None:
        at: dict[str, Any] = {} if self._socket is None else {"unix": True, "path": self._socket}
        async with connect(
            _LOCAL if at else self.url,
            **at,
            subprotocols=[CBOR_PROTOCOL],  # type: ignore[list-item]
            compression=None,
            max_size=self._most_bytes,
            ping_interval=_KEEPALIVE_S,
            ping_timeout=_KEEPALIVE_S,
            close_timeout=1.0,
            proxy=None,
        ) as connection:
            self._state.begin(cbor=connection.subprotocol == CBOR_PROTOCOL)
            self._joined()
            writer = asyncio.create_task(self._write(connection))
            try:
                async for frame in connection:
                    self._receive(frame)
            finally:
                writer.cancel()
                await asyncio.gather(writer, return_exceptions=True)

    def _receive(self, frame: Frame) -> None:
        self._state.receive(frame, time.monotonic())

    async def _write(self, connection: ClientConnection) -> None:
        turns = itertools.count(1)
        while True:
            self._wanted.clear()
            for frame in self._state.frames():
                await connection.send(frame)
                if next(turns) % 32 == 0:
                    await asyncio.sleep(0)
            await self._wanted.wait()


def _no_address(url: str) -> BridgeError:
    return BridgeError(f"'{url}' is not a rosbridge address; use ws://HOST:PORT")
