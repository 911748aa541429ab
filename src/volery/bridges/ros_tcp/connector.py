"""Connects the simulation to a ROS-TCP-Endpoint, in the place of a Unity project.

    bridges.open(RosTcpConnector("127.0.0.1", 10000))

The endpoint need not exist yet: the bridge connects when it can, and reconnects after a loss. The
bridge reports both, and the endpoint's error messages.
"""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from collections import deque
from collections.abc import Callable, Sequence
from functools import partial

from volery.bridges.loop_waker import wake_of
from volery.bridges.ros_tcp import wire as ros_tcp
from volery.bridges.ros_tcp.connection import RosTcpConnection
from volery.bridges.ros_tcp.unity import Selection, UnitySession
from volery.bridges.ros_tcp.wire import Generation, RosTcpFrameParser
from volery.core.errors import BridgeError
from volery.graph.qos import DEFAULT_DEPTH
from volery.graph.session import Gateway
from volery.graph.subscription_queue import Wake

KEEPALIVE_S = 1.0
"""Seconds without a frame after which Unity's Connector sends a keepalive."""
FIRST_PAUSE_S = 0.2
LONGEST_PAUSE_S = 5.0
"""Largest pause between two attempts; pauses double up to it."""
_CONNECT_S = 5.0
_UNANSWERED_MS = 15_000
"""Time for which sent bytes may stay unacknowledged before the endpoint counts as gone, ms."""


_REFRESH_S = 0.5
_NOTES = 100
_MAX_REPORTS = 100
"""Number of different reports; repeated errors of an endpoint do not fill a terminal."""
_FIRST_ATTEMPT_S = 1.0
"""Time for which `start` waits for the outcome of the first attempt."""
_SPOKEN = {"ros1": "ROS 1", "ros2": "ROS 2"}

_log = logging.getLogger(__name__)


class RosTcpConnector:
    """A bridge that is a client of an external endpoint.

    Parameters
    ----------
    host, port
        Address of the endpoint.
    publish, subscribe, services
        Patterns of shared names; see `Selection`.
    depth
        Queue depth of each topic for a slow endpoint; the oldest messages are dropped.
    handshake_s
        Time without a handshake after which the endpoint counts as ROS 1, before 0.7.
        Called in the bridges' thread with a line of text, whenever a connection starts or ends
        and for each new error; without it they are logged.

    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 10000,
        *,
        publish: Sequence[str] = Selection.publish,
        subscribe: Sequence[str] = Selection.subscribe,
        services: Sequence[str] = Selection.services,
        depth: int = DEFAULT_DEPTH,
        handshake_s: float = 2.0,
        report: Callable[[str], None] | None = None,
    ) -> None:
        if not 1 <= port <= 65535:
            raise BridgeError(f"ROS-TCP: port must be 1 to 65535, not {port}")
        self._address = (host, port)
        self._selection = Selection(tuple(publish), tuple(subscribe), tuple(services))
        self._depth = depth
        self._handshake_s = handshake_s
        self._task: asyncio.Task[None] | None = None
        self._session: UnitySession | None = None
        self._notes: deque[str] = deque(maxlen=_NOTES)
        self._report = report or _log.warning
        self._reported: set[str] = set()
        self._is_known = asyncio.Event()
        """Whether the outcome of the first attempt is known."""
        self._was_lost = False

    @property
    def name(self) -> str:
        """Name, address and state of the bridge."""
        return f"{self._target} ({self.state})"

    @property
    def _target(self) -> str:
        host, port = self._address
        return f"ROS-TCP to {host}:{port}"

    @property
    def state(self) -> str:
        """`not connected`, `awaiting the handshake`, `ros1` or `ros2`."""
        session = self._session
        if session is None:
            return "not connected"
        return session.generation or "awaiting the handshake"

    @property
    def notes(self) -> tuple[str, ...]:
        """Messages of the endpoint, and reasons of ended connections: the newest hundred lines."""
        return tuple(self._notes)

    async def start(self, gateway: Gateway) -> None:
        """Starts to connect; returns when the outcome is known, after a second at the latest."""
        self._task = asyncio.get_running_loop().create_task(self._stay_connected(gateway))
        try:
            async with asyncio.timeout(_FIRST_ATTEMPT_S):
                await self._is_known.wait()
        except TimeoutError:
            return

    async def stop(self) -> None:
        """Disconnects."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None

    async def _stay_connected(self, gateway: Gateway) -> None:
        pause_s = FIRST_PAUSE_S
        while True:
            try:
                sock = await dial(*self._address)
            except (OSError, TimeoutError) as error:
                why = os.strerror(error.errno) if error.errno else str(error) or "no answer"
                self._note(f"cannot connect: {why}; retrying until an endpoint answers")
                self._is_known.set()
            else:
                began_s = asyncio.get_running_loop().time()
                if await self._serve(gateway, sock):
                    lasted_s = asyncio.get_running_loop().time() - began_s
                    pause_s = FIRST_PAUSE_S if lasted_s > LONGEST_PAUSE_S else pause_s
            await asyncio.sleep(pause_s)
            pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)

    async def _serve(self, gateway: Gateway, sock: socket.socket) -> bool:
        """Acts as a Unity client until the connection ends; returns whether the protocol began."""
        host, port = self._address
        note = self._note
        open_session = partial(
            UnitySession,
            gateway,
            f"ros-tcp to {host}:{port}",
            self._selection,
            self._depth,
            note,
            begun=self._begun,
        )
        try:
            connection = _Connection(sock, open_session, note)
        except OSError as error:
            note(f"the connection has ended: {error.strerror}")
            return False
        self._session = connection.session
        try:
            await connection.attend(self._handshake_s)
        finally:
            self._session = None
            connection.stream.close("the bridge was closed")
        note(f"the connection has ended: {connection.ended.result()}")
        self._was_lost = True
        return connection.session.generation is not None

    def _begun(self, generation: Generation) -> None:
        """Reports the connection after the handshake, or after the time for it."""
        again = " again" if self._was_lost else ""
        self._report(f"{self._target}: connected{again}, messages of {_SPOKEN[generation]}")
        self._reported.clear()
        self._is_known.set()

    def _note(self, text: str) -> None:
        """Stores a line, and reports it once per connection."""
        if not self._notes or self._notes[-1] != text:
            self._notes.append(text)
        if text not in self._reported and len(self._reported) < _MAX_REPORTS:
            self._reported.add(text)
            self._report(f"{self._target}: {text}")


class _Connection:
    """A connected socket and its session."""

    def __init__(
        self,
        sock: socket.socket,
        open_session: Callable[[Wake], UnitySession],
        note: Callable[[str], None],
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._note = note
        self.ended: asyncio.Future[str] = self._loop.create_future()
        """Holds the reason, once there is one."""
        self.session = session = open_session(wake_of(self._loop, self._flush))
        try:
            self.stream = RosTcpConnection(
                sock, RosTcpFrameParser(), session.outbox, session.take, note, self._closed
            )
        except OSError:
            session.close()
            sock.close()
            raise

    async def attend(self, handshake_s: float) -> None:
        """Registers new names and sends keepalives, until the connection ends."""
        latest_s = self._loop.time() + handshake_s
        self.stream.flush()
        while not self.ended.done():
            await asyncio.wait([self.ended], timeout=min(_REFRESH_S, handshake_s))
            now_s = self._loop.time()
            if self.session.generation is not None:
                self.session.refresh()
            elif now_s >= latest_s:
                self._note("no handshake: assuming an endpoint of ROS 1 before version 0.7")
                self.session.begin("ros1")
            if now_s >= self.stream.last_sent_s + KEEPALIVE_S and not self.session.outbox.crowded:
                self.session.outbox.put(ros_tcp.KEEPALIVE)

    def _flush(self) -> None:
        self.stream.flush()

    def _closed(self, reason: str) -> None:
        self.session.close()
        if not self.ended.done():
            self.ended.set_result(reason)


async def dial(host: str, port: int) -> socket.socket:
    """Returns a connected socket. Raises `OSError` or `TimeoutError` if no server answers."""
    loop = asyncio.get_running_loop()
    (family, *_, address), *_ = await loop.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    sock = socket.socket(family, socket.SOCK_STREAM)
    try:
        sock.setblocking(False)
        async with asyncio.timeout(_CONNECT_S):  # unlike wait_for it never loses a cancellation
            await loop.sock_connect(sock, address)
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNANSWERED_MS)
    except BaseException:
        sock.close()
        raise
    return sock
