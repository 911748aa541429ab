"""A program's part in a graph that a rosbridge server offers: ours, or a real robot's.

    client = RosbridgeClient("ws://127.0.0.1:9090", name="planner")
    mailbox = client.subscribe("/uav1/odom", "nav_msgs/msg/Odometry", wake=wake)
    client.advertise("/uav1/cmd_vel", "geometry_msgs/msg/Twist")
    client.publish("/uav1/cmd_vel", Twist(...))

It has the methods and the meaning of `graph.session.Session`. It keeps its connection: when that
breaks it comes back by itself, and announces, subscribes to and offers everything again.
"""

from __future__ import annotations

import asyncio
import itertools
import threading
import time
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import WebSocketException

from volery.bridges.rosbridge.client_state import ClientState
from volery.bridges.rosbridge.forms import Generation
from volery.bridges.rosbridge.wire import CBOR_PROTOCOL, MOST_MESSAGE_BYTES, Frame
from volery.core.errors import BridgeError, GraphError, UnreachableError
from volery.graph.mailbox import Mailbox, Wake
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.reply import Reply
from volery.graph.session import Handler, SessionInfo

_FIRST_PAUSE_S = 0.1
_LONGEST_PAUSE_S = 5.0
_KEEPALIVE_S = 20.0


class RosbridgeClient:
    """One program's part in a remote graph. All methods may be called by any thread.

    Parameters
    ----------
    url
        `ws://host:port/path` or `wss://...`.
    name
        Who it is, for people.
    token
        Shown to the server, if given.
    generation
        Spelling of types and times that the server understands; ours understands both.
    connect_timeout_s
        How long to try at first; 0: do not wait, keep trying in the background.

    Raises
    ------
    BridgeError
        The URL is none, or nobody answers there in time.

    """

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
        if not url.startswith(("ws://", "wss://")):
            raise BridgeError(f"'{url}' is no address of a rosbridge: ws://HOST:PORT")
        self.name = name
        self.url = url
        self._most_bytes = max_message_bytes
        self._loop = asyncio.new_event_loop()
        self._wanted = asyncio.Event()
        self._state = ClientState(token, self._wake_writer, generation)
        self._connected = threading.Event()
        self._trouble = "no answer"
        self._closed = False
        self._connections = 0
        self._main = self._loop.create_task(self._keep_connected())
        self._thread = threading.Thread(target=self._run, name=f"{name}-rosbridge", daemon=True)
        self._thread.start()
        if connect_timeout_s:
            try:
                self.wait_until_connected(connect_timeout_s)
            except BridgeError:
                self.close()
                raise

    # --------------------------------------------------------------------------------- connection

    @property
    def connected(self) -> bool:
        """Whether the server is there at the moment."""
        return self._connected.is_set()

    @property
    def connections(self) -> int:
        """How often it has been connected."""
        return self._connections

    def wait_until_connected(self, timeout_s: float) -> None:
        """Wait for the server. `BridgeError` where it does not answer in time."""
        if not self._connected.wait(timeout_s):
            raise UnreachableError(f"nobody speaks rosbridge at {self.url}: {self._trouble}")

    @property
    def trouble(self) -> tuple[str, ...]:
        """The newest complaints of the server."""
        return tuple(self._state.complaints)

    @property
    def dropped(self) -> int:
        """Publications that found no connection, or too slow a one."""
        return self._state.dropped

    # ------------------------------------------------------------------------------------ topics

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Announce that messages will be published on `topic`. `GraphError` for a wrong type."""
        self._check_open()
        self._state.advertise(topic, msgtype, latched)

    def unadvertise(self, topic: str) -> None:
        """Publish on `topic` no more. `GraphError` if it did not."""
        self._state.unadvertise(topic, self.name)

    def published_type(self, topic: str) -> str | None:
        """Type that was announced for `topic`; None if it was not."""
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
    ) -> Mailbox:
        """Begin to receive `topic`; without a type the server is asked for it.

        `wake` is called from the client's thread when a message comes to an empty mailbox.
        """
        self._check_open()
        if msgtype is None:
            msgtype = self._ask_type("topic_type", {"topic": topic})
            if not msgtype:
                raise GraphError(f"no topic '{topic}'; give a type to subscribe before it exists")
        return self._state.subscribe(topic, msgtype, depth, reliable, wake)

    def unsubscribe(self, mailbox: Mailbox) -> None:
        """Receive no more; what waits can still be taken."""
        self._state.unsubscribe(mailbox)

    # ---------------------------------------------------------------------------------- services

    def call(self, service: str, request: Any | None, reply: Reply) -> None:
        """Call a service; `reply` gets the response or a `GraphError` in the client's thread.

        Calls that are open when the connection breaks fail.
        """
        self._check_open()
        self._state.call(service, request, reply)

    def offer(self, service: str, srvtype: str, handler: Handler) -> None:
        """Offer a service; `handler(request, reply)` is called in the client's thread."""
        self._check_open()
        self._state.offer(service, srvtype, handler)

    def withdraw(self, service: str) -> None:
        """Offer a service no more. `GraphError` if it was not offered."""
        self._state.withdraw(service, self.name)

    def _ask_type(self, service: str, args: dict[str, Any]) -> str:
        """Ask rosapi, and wait for its answer."""
        if threading.current_thread() is self._thread:
            raise GraphError("give a type: the client's own thread cannot wait for the server")
        found: Future[str] = Future()
        self._state.ask_rosapi(service, args, found)
        try:
            return found.result(5.0)
        except FutureTimeoutError:
            raise GraphError(f"rosapi at {self.url} does not answer") from None

    # --------------------------------------------------------------------------------------- end

    def close(self) -> None:
        """Leave; a second time nothing happens."""
        if self._closed:
            return
        self._closed = True
        self._loop.call_soon_threadsafe(self._main.cancel)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    @property
    def info(self) -> SessionInfo:
        """What the client does at present."""
        return self._state.info(self.name)

    def _check_open(self) -> None:
        if self._closed:
            raise GraphError(f"{self.name} has left")

    # ------------------------------------------------------------------------------- its thread

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._main)
        except asyncio.CancelledError:
            pass
        finally:
            self._connected.clear()
            self._state.lose(f"{self.name} has left")
            self._loop.close()

    def _wake_writer(self) -> None:
        try:
            self._loop.call_soon_threadsafe(self._wanted.set)
        except RuntimeError:  # the loop has ended
            return

    async def _keep_connected(self) -> None:
        pause_s = _FIRST_PAUSE_S
        while True:
            began_s = time.monotonic()
            try:
                await self._connect_once()
                self._trouble = "the server has closed the connection"
            except (WebSocketException, OSError, ValueError) as error:  # or no such address can be
                self._trouble = str(error) or type(error).__name__
            finally:
                self._connected.clear()
                self._state.lose(f"the connection to {self.url} is broken")
            lasted = time.monotonic() - began_s > _LONGEST_PAUSE_S
            pause_s = _FIRST_PAUSE_S if lasted else min(_LONGEST_PAUSE_S, 2 * pause_s)
            await asyncio.sleep(pause_s)

    async def _connect_once(self) -> None:
        async with connect(
            self.url,
            subprotocols=[CBOR_PROTOCOL],  # type: ignore[list-item]
            compression=None,
            max_size=self._most_bytes,
            ping_interval=_KEEPALIVE_S,
            ping_timeout=_KEEPALIVE_S,
            close_timeout=1.0,
            proxy=None,
        ) as connection:
            self._state.begin(cbor=connection.subprotocol == CBOR_PROTOCOL)
            self._connections += 1
            self._connected.set()
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
