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
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from typing import Any, TypeVar

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidURI, WebSocketException
from websockets.uri import parse_uri

from volery.bridges.loop_waker import wake_of
from volery.bridges.rosbridge.client_state import ClientState
from volery.bridges.rosbridge.message_encoder import Generation
from volery.bridges.rosbridge.wire import CBOR_PROTOCOL, MAX_MESSAGE_BYTES, Frame
from volery.core.errors import BridgeError, GraphError, UnreachableError, reason_of
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.service_reply import ServiceReply
from volery.graph.session import Handler, SessionInfo
from volery.graph.subscription_queue import SubscriptionQueue, Wake

T = TypeVar("T")

_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 5.0
_KEEPALIVE_S = 20.0
_ANSWER_TIMEOUT_S = 5.0
_UNIX, _LOCAL = "unix://", "ws://localhost/"


class RosbridgeClient:
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

    def __init__(
        self,
        url: str,
        *,
        name: str = "volery",
        token: str | None = None,
        connect_timeout_s: float = 5.0,
        max_message_bytes: int = MAX_MESSAGE_BYTES,
        generation: Generation = "ros2",
    ) -> None:
        self._socket = url.removeprefix(_UNIX) if url.startswith(_UNIX) else None
        if self._socket is None and not url.startswith(("ws://", "wss://")):
            raise _no_address(url)
        try:
            parse_uri(_LOCAL if self._socket else url)
        except (InvalidURI, ValueError):
            raise _no_address(url) from None
        self.name, self.url = name, url
        self._why = "no answer"
        """Why there is no connection."""
        self._loop = asyncio.new_event_loop()
        self._connected = threading.Event()
        self._connections = 0
        self._closed = False
        self._max_bytes = max_message_bytes
        self._wanted = asyncio.Event()
        self._state = ClientState(token, wake_of(self._loop, self._wanted.set), generation)
        self._start(connect_timeout_s)

    def _start(self, connect_timeout_s: float) -> None:
        """Starts to connect. Raises `BridgeError` if no server answers in time; 0: do not wait."""
        self._main = self._loop.create_task(self._keep_connected())
        name = f"{self.name}-rosbridge"
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()
        if connect_timeout_s:
            try:
                self.wait_until_connected(connect_timeout_s)
            except BaseException:  # also after Ctrl-C, or its thread runs into the end of Python
                self.close()
                raise

    # --------------------------------------------------------------------------------- connection

    @property
    def connected(self) -> bool:
        """Whether the server is connected."""
        return self._connected.is_set()

    @property
    def connections(self) -> int:
        """Number of connections so far."""
        return self._connections

    def wait_until_connected(self, timeout_s: float) -> None:
        """Waits for the server. Raises `BridgeError` if it does not answer in time."""
        if not self._connected.wait(timeout_s):
            raise UnreachableError(f"no rosbridge server at {self.url}: {self._why}")

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

    # ------------------------------------------------------------------------------------ topics

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Advertises `topic`. Raises `GraphError` for a wrong type."""
        self._check_open()
        self._state.advertise(topic, msgtype, latched)

    def unadvertise(self, topic: str) -> None:
        """Ends the publication of `topic`. Raises `GraphError` if there was none."""
        self._state.unadvertise(topic, self.name)

    def published_type(self, topic: str) -> str | None:
        """Returns the advertised type of `topic`; None if it is not advertised."""
        return self._state.published_type(topic)

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message of the announced type.

        Without a connection it is dropped; of what the network is too slow for, the oldest.
        """
        self._check_open()
        self._state.publish(topic, message, self.name)

    def subscribe(
        self,
        topic: str,
        msgtype: str | None = None,
        *,
        depth: int = DEFAULT_DEPTH,
        reliable: bool = False,
        wake: Wake,
    ) -> SubscriptionQueue:
        """Subscribes like `GraphConnection.subscribe`.

        Without a type the client asks the server for it.
        """
        self._check_open()
        if msgtype is None:
            msgtype = self._type_of(topic)
            if not msgtype:
                raise GraphError(f"no topic '{topic}'; give a type to subscribe before it exists")
        return self._state.subscribe(topic, msgtype, depth, reliable, wake)

    def unsubscribe(self, queue: SubscriptionQueue) -> None:
        """Ends a subscription; queued messages remain available."""
        self._state.unsubscribe(queue)

    def _type_of(self, topic: str) -> str:
        return self._ask(
            lambda found: self._state.ask_rosapi("topic_type", {"topic": topic}, found),
            f"rosapi at {self.url} does not answer",
        )

    def _ask(self, ask: Callable[[Future[T]], object], silence: str) -> T:
        """Sends a request with `ask` and waits for the answer.

        Raises `GraphError` with the text `silence` if no answer arrives, and also in the client's
        own thread, which would wait for itself.
        """
        if threading.current_thread() is self._thread:
            raise GraphError("give a type: the client's own thread cannot wait for the server")
        found: Future[T] = Future()
        ask(found)
        try:
            return found.result(_ANSWER_TIMEOUT_S)
        except FutureTimeoutError:
            raise GraphError(silence) from None

    # ---------------------------------------------------------------------------------- services

    def call(self, service: str, request: Any | None, reply: ServiceReply) -> None:
        """Calls a service; `reply` receives the response or a `GraphError` in the client's thread.

        Calls that are open when the connection breaks fail.
        """
        self._check_open()
        self._state.call(service, request, reply)

    def create_service(self, service: str, srvtype: str, handler: Handler) -> None:
        """Creates a service; `handler(request, reply)` is called in the client's thread."""
        self._check_open()
        self._state.create_service(service, srvtype, handler)

    def destroy_service(self, service: str) -> None:
        """Destroys a service. Raises `GraphError` if it does not exist."""
        self._state.destroy_service(service, self.name)

    # --------------------------------------------------------------------------------------- end

    def close(self) -> None:
        """Disconnects; further calls do nothing."""
        if self._closed:
            return
        self._closed = True
        self._loop.call_soon_threadsafe(self._leave)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _check_open(self) -> None:
        if self._closed:
            raise GraphError(f"{self.name} is closed")

    # ------------------------------------------------------------------------------- its thread

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._main)
        except asyncio.CancelledError:
            pass
        finally:
            self._lose(f"{self.name} is closed")
            self._loop.close()

    def _joined(self) -> None:
        """Marks the client as connected, after the server has received all requests."""
        self._connections += 1
        self._connected.set()

    def _lose(self, why: str) -> None:
        """Marks the client as disconnected."""
        self._connected.clear()
        self._state.lose(why)

    def _leave(self) -> None:
        """Ends `_keep_connected`, after `close`."""
        self._main.cancel()

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
            max_size=self._max_bytes,
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
