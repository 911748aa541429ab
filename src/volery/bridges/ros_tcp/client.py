"""A program's part in a graph that a ROS-TCP endpoint offers: ours, or Unity's ROS-TCP-Endpoint.

    client = RosTcpClient("127.0.0.1", 10000, name="planner")
    mailbox = client.subscribe("/uav1/odom", "nav_msgs/msg/Odometry", wake=wake)
    client.advertise("/uav1/cmd_vel", "geometry_msgs/msg/Twist")
    client.publish("/uav1/cmd_vel", Twist(...))

It has the methods and the meaning of `graph.session.Session`. It keeps its connection: when that
breaks it comes back by itself, and announces, subscribes to and offers everything again.
"""

from __future__ import annotations

import asyncio
import socket
import threading
from collections import deque
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from typing import Any

from volery.bridges.doors import wake_of
from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.client_line import Line
from volery.bridges.ros_tcp.client_services import ClientServices
from volery.bridges.ros_tcp.client_topics import ClientTopics
from volery.bridges.ros_tcp.dial import FIRST_PAUSE_S, KEEPALIVE_S, LONGEST_PAUSE_S, dial
from volery.bridges.ros_tcp.payloads import payloads_of
from volery.bridges.ros_tcp.pipe import Pipe
from volery.bridges.ros_tcp.wire import Frame, FrameParser, Generation, number_field
from volery.core.errors import BridgeError, GraphError, UnreachableError
from volery.graph.mailbox import Mailbox, Wake
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.reply import Reply
from volery.graph.session import Handler, SessionInfo

MOST_COMPLAINTS = 100
_LIST_TIMEOUT_S = 5.0


class RosTcpClient:
    """One program's part in a remote graph. All methods may be called by any thread.

    Parameters
    ----------
    host, port
        Where the endpoint listens.
    name
        Who it is, for people.
    generation
        Of ROS, of an endpoint that sends no handshake, as those before 0.7; others tell theirs.
    connect_timeout_s
        How long to try at first; 0: do not wait, keep trying in the background.
    handshake_s
        After so long an endpoint counts as one that sends no handshake.

    Raises
    ------
    BridgeError
        Nobody answers there in time, or somebody who does not speak ROS-TCP.

    """

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
        self.name = name
        self._address = (host, port)
        self._generation: Generation = generation
        self._handshake_s = handshake_s
        self._loop = asyncio.new_event_loop()
        self._line = Line(wake_of(self._loop, self._flush))
        self._topics = ClientTopics(self._line)
        self._services = ClientServices(self._line)
        self._body: tuple[str, int] | None = None
        self._pipe: Pipe | None = None
        self._complaints: deque[str] = deque(maxlen=MOST_COMPLAINTS)
        self._connected = threading.Event()
        self._why = "no answer"
        self._connections = 0
        self._closed = False
        self._main = self._loop.create_task(self._keep_connected())
        self._thread = threading.Thread(target=self._run, name=f"{name}-ros-tcp", daemon=True)
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
        """Whether the endpoint is there at the moment."""
        return self._connected.is_set()

    @property
    def connections(self) -> int:
        """How often it has been connected."""
        return self._connections

    def wait_until_connected(self, timeout_s: float) -> None:
        """Wait for the endpoint. `BridgeError` where it does not answer in time."""
        if not self._connected.wait(timeout_s):
            raise UnreachableError(f"nobody speaks ROS-TCP at {self._where}: {self._why}")

    @property
    def trouble(self) -> tuple[str, ...]:
        """The newest complaints of the endpoint, and those about it."""
        return tuple(self._complaints)

    @property
    def dropped(self) -> int:
        """Publications that found no connection, or too slow a one."""
        return self._line.dropped

    # ------------------------------------------------------------------------------------ topics

    def advertise(self, topic: str, msgtype: str, *, latched: bool = False) -> None:
        """Announce that messages will be published on `topic`. `GraphError` for a wrong type."""
        self._check_open()
        self._topics.advertise(topic, msgtype, latched)

    def unadvertise(self, topic: str) -> None:
        """Publish on `topic` no more. `GraphError` if it did not."""
        self._topics.unadvertise(topic, self.name)

    def published_type(self, topic: str) -> str | None:
        """Type that was announced for `topic`; None if it was not."""
        return self._topics.published_type(topic)

    def publish(self, topic: str, message: Any) -> None:
        """Publish a message of the announced type.

        Without a connection it is dropped; of what the network is too slow for, the oldest.
        """
        self._check_open()
        self._topics.publish(topic, message, self.name)

    def subscribe(
        self,
        topic: str,
        msgtype: str | None = None,
        *,
        depth: int = DEFAULT_DEPTH,
        reliable: bool = False,
        wake: Wake,
    ) -> Mailbox:
        """Begin to receive `topic`; without a type the endpoint is asked for it.

        `wake` is called from the client's thread when a message comes to an empty mailbox.
        """
        self._check_open()
        if msgtype is None:
            msgtype = self.topic_types().get(topic)
            if msgtype is None:
                raise GraphError(f"no topic '{topic}'; give a type to subscribe before it exists")
        return self._topics.subscribe(topic, msgtype, depth, reliable, wake)

    def unsubscribe(self, mailbox: Mailbox) -> None:
        """Receive no more; what waits can still be taken."""
        self._topics.unsubscribe(mailbox)

    def topic_types(self) -> dict[str, str]:
        """Topics of the graph and their types, by name. `GraphError` where no answer comes."""
        if threading.current_thread() is self._thread:
            raise GraphError("give a type: the client's own thread cannot wait for the endpoint")
        found: Future[dict[str, str]] = Future()
        self._topics.ask_list(Reply(found.set_result, found.set_exception))
        try:
            return found.result(_LIST_TIMEOUT_S)
        except FutureTimeoutError:
            raise GraphError(f"the endpoint at {self._where} tells no topics") from None

    # ---------------------------------------------------------------------------------- services

    def call(self, service: str, request: Any | None, reply: Reply) -> None:
        """Call a service; `reply` gets the response or a `GraphError` in the client's thread.

        Calls that are open when the connection breaks fail.
        """
        self._check_open()
        self._services.call(service, request, reply)

    def offer(self, service: str, srvtype: str, handler: Handler) -> None:
        """Offer a service; `handler(request, reply)` is called in the client's thread."""
        self._check_open()
        self._services.offer(service, srvtype, handler)

    def withdraw(self, service: str) -> None:
        """Offer a service no more. `GraphError` if it was not offered."""
        self._services.withdraw(service, self.name)

    # --------------------------------------------------------------------------------------- end

    def close(self) -> None:
        """Leave, once what waits is sent; a second time nothing happens."""
        if self._closed:
            return
        self._closed = True
        self._loop.call_soon_threadsafe(self._leave)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    @property
    def info(self) -> SessionInfo:
        """What the client does at present."""
        publishes, mailboxes = self._topics.info
        return SessionInfo(self.name, publishes, mailboxes, self._services.offered)

    @property
    def _where(self) -> str:
        host, port = self._address
        return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"

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
            self._lose(f"{self.name} has left")
            self._loop.close()

    def _leave(self) -> None:
        if self._pipe is None:
            self._main.cancel()
        else:
            self._pipe.finish()

    def _flush(self) -> None:
        if self._pipe is not None:
            self._pipe.flush()

    async def _keep_connected(self) -> None:
        pause_s = FIRST_PAUSE_S
        while True:
            before = self._connections
            try:
                await self._serve(await dial(*self._address))
            except (OSError, TimeoutError, UnicodeError) as error:  # or no such name can be
                self._why = str(error) or "no answer"
            self._lose(f"the connection to {self._where} is broken")
            if self._closed:
                return
            pause_s = FIRST_PAUSE_S if self._connections > before else pause_s
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)

    async def _serve(self, sock: socket.socket) -> None:
        """Take part until the connection ends."""
        ended: asyncio.Future[None] = self._loop.create_future()
        reasons: list[str] = []

        def closed(reason: str) -> None:
            self._pipe = None
            reasons.append(reason)
            if not ended.done():
                ended.set_result(None)

        def broken(reason: str) -> None:
            reasons.append(reason)
            self._complaints.append(reason)

        self._body = None
        try:
            pipe = Pipe(sock, FrameParser(), self._line, self._take, broken, closed)
        except OSError:
            sock.close()
            raise
        self._pipe = pipe
        try:
            self._line.keep_alive()
            await self._attend(pipe, ended)
        finally:
            pipe.close(f"{self.name} has left")
        self._why = reasons[0]

    async def _attend(self, pipe: Pipe, ended: asyncio.Future[None]) -> None:
        """Show that we live, until the connection ends."""
        latest_s = self._loop.time() + self._handshake_s
        while not ended.done():
            await asyncio.wait([ended], timeout=min(KEEPALIVE_S / 2.0, self._handshake_s))
            now_s = self._loop.time()
            if not self._line.open and now_s >= latest_s and not ended.done():
                self._begin(self._generation, frozenset())
            if now_s >= pipe.last_sent_s + KEEPALIVE_S and not self._line.crowded:
                self._line.keep_alive()

    def _begin(self, generation: Generation, features: frozenset[str]) -> None:
        """The endpoint can be spoken to: ask for everything."""
        with self._line.lock:
            self._line.begin(generation, features)
            self._topics.repeat()
            self._services.repeat()
        self._connections += 1
        self._connected.set()

    def _lose(self, why: str) -> None:
        self._connected.clear()
        self._line.lose()
        self._topics.lose(why)
        self._services.lose(why)

    # ------------------------------------------------------------------------------------- input

    def _take(self, frame: Frame) -> None:
        """Do what a frame asks for. `BridgeError` for a handshake that cannot be understood."""
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
            self._complaints.append(f"{frame.destination[:200]}: {error}")

    def _command(self, name: str, fields: dict[str, Any]) -> None:
        if name in ("__request", "__response"):
            self._body = name, number_field(fields, "srv_id")
        elif name == "__topic_list":
            self._topics.take_list(fields)
        elif name in ("__error", "__warn", "__log"):
            text = str(fields.get("text", ""))[:1000]
            self._complaints.append(text)
            if name == "__error":
                self._services.hear_error(text)
