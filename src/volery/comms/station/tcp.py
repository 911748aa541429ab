"""A station on TCP: sockets and the wall clock around `StationCore`.

    station = Station(Identity(0, 1), on_message=take)
    await station.start()
    station.send(StationFrameKind.COMMAND, 3, b"...")

It reconnects every 0.2 s after a failure without losing sent messages; guarantees: docs/comms.md.
"""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Callable

from volery.comms.addresses import GROUP_SIZE, Identity
from volery.comms.control_payloads import Refusal
from volery.comms.protocol import StationFrame, StationFrameKind
from volery.comms.server.tcp import PORT
from volery.comms.station.core import StationCore
from volery.core.errors import CommsError
from volery.core.network_access import tend, write_while_open

_AGAIN_S = 0.2
_CONNECT_S = 1.0
_TICK_S = 0.5
_ACKNOWLEDGE_S = 0.05


def _ignore(_what: object) -> None:
    """Ignores an event."""


class Station:
    """One station, in one asyncio loop.

    Parameters
    ----------
    identity
        Batch and plane, or `Identity.ground()`.
    on_message, on_refusal
        Called in the loop with received messages and refusals, each once, in order.
    on_joined
        Called in the loop with True when a server has welcomed it, with False when that connection
        is lost; not by `stop`.
    host, port
        Of the communication server.
    name, token, group_size
        Sent to the server.

    """

    def __init__(
        self,
        identity: Identity,
        on_message: Callable[[StationFrame], None] = _ignore,
        on_refusal: Callable[[Refusal], None] = _ignore,
        *,
        on_joined: Callable[[bool], None] = _ignore,
        host: str = "127.0.0.1",
        port: int = PORT,
        name: str = "",
        token: str | None = None,
        group_size: int = GROUP_SIZE,
    ) -> None:
        self.core = StationCore(
            identity,
            secrets.randbits(32),
            name=name,
            token=token,
            group_size=group_size,
        )
        self._on_message = on_message
        self._on_refusal = on_refusal
        self._on_joined = on_joined
        self._address = (host, port)
        self._connection: _ServerConnection | None = None
        self._task: asyncio.Task[None] | None = None
        self._acknowledges: asyncio.TimerHandle | None = None
        self._changed = asyncio.Event()
        self._sends = False

    @property
    def joined(self) -> bool:
        """Whether a server has welcomed it and the connection is open."""
        return self.core.joined

    async def start(self, timeout_s: float | None = 5.0) -> None:
        """Joins, and reconnects whenever the connection fails.

        timeout_s: None returns without waiting for the server.

        Raises
        ------
        CommsError
            No server listens there, or it refuses this station.

        """
        self._loop = asyncio.get_running_loop()
        self._task = asyncio.create_task(self._keep_joined())
        if timeout_s is None:
            return
        try:
            await asyncio.wait_for(self.until_joined(), timeout_s)
        except TimeoutError:
            await self.stop()
            host, port = self._address
            raise CommsError(
                f"no communication server at {host}:{port}; start one with volery comms"
            ) from None
        except CommsError:
            await self.stop()
            raise

    async def stop(self) -> None:
        """Leaves and drops unsettled messages; see `until_settled`."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
            self._task = None
        if self._connection is not None:
            self._on_joined = _ignore
            self._connection.transport.abort()
            self._lost(self._connection)

    def send(self, kind: StationFrameKind, destination: int, payload: bytes) -> int:
        """Sends a message, now or once a server is connected; raises like `StationCore.send`."""
        sequence = self.core.send(kind, destination, payload, time.monotonic_ns(), time.time_ns())
        if not self._sends:  # once for all messages of this turn of the loop
            self._sends = True
            self._loop.call_soon(self._flush)
        return sequence

    async def until_joined(self) -> None:
        """Waits for the server's welcome. Raises CommsError if the server refuses for good."""
        while not self.joined:
            if self.core.fatal is not None:
                raise CommsError(f"the server refuses this station: {self.core.fatal.text}")
            await self._next_change()

    async def until_settled(self) -> None:
        """Waits until the server has settled all sent messages."""
        while self.core.unsettled:
            await self._next_change()

    async def _next_change(self) -> None:
        self._changed.clear()
        await self._changed.wait()

    # ------------------------------------------------------------------------------ the connection

    async def _keep_joined(self) -> None:
        while self.core.fatal is None:
            if self._connection is None:
                await self._connect()
                await asyncio.sleep(0 if self._connection is not None else _AGAIN_S)
                continue
            await asyncio.sleep(_TICK_S if self.joined else _AGAIN_S)
            self._tick()

    async def _connect(self) -> None:
        try:
            # Not `wait_for`: in Python 3.11 that can lose a cancellation.
            async with asyncio.timeout(_CONNECT_S):
                await self._loop.create_connection(lambda: _ServerConnection(self), *self._address)
        except (TimeoutError, OSError, OverflowError):
            return

    def _tick(self) -> None:
        connection, now_ns = self._connection, time.monotonic_ns()
        if connection is None:
            return
        if self.core.is_deaf(now_ns):
            connection.transport.abort()
            return
        self.core.tick(now_ns)
        self._flush()

    def _opened(self, connection: _ServerConnection) -> None:
        self._connection = connection
        self.core.connected(time.monotonic_ns())
        self._flush()

    def _came(self, data: bytes) -> None:
        before = self.joined
        for frame in self.core.feed(data, time.monotonic_ns()):
            self._on_message(frame)
        while self.core.refusals:
            self._on_refusal(self.core.refusals.popleft())
        if self.joined and not before:
            self._on_joined(True)
        if self.core.has_to_acknowledge and self._acknowledges is None:
            self._acknowledges = self._loop.call_later(_ACKNOWLEDGE_S, self._acknowledge)
        self._flush()
        self._changed.set()

    def _acknowledge(self) -> None:
        self._acknowledges = None
        self.core.acknowledge(time.monotonic_ns())
        self._flush()

    def _lost(self, connection: _ServerConnection) -> None:
        if self._connection is connection:
            self._connection, before = None, self.joined
            self.core.disconnected()
            if before:
                self._on_joined(False)
            self._changed.set()

    def _flush(self) -> None:
        self._sends = False
        connection = self._connection
        if connection is not None and not connection.paused and (data := self.core.take()):
            write_while_open(connection.transport, data)


class _ServerConnection(asyncio.Protocol):
    """One connection of a station."""

    transport: asyncio.Transport

    def __init__(self, station: Station) -> None:
        self._station = station
        self.paused = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Implements asyncio.Protocol."""
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport
        tend(transport.get_extra_info("socket"))
        self._station._opened(self)

    def data_received(self, data: bytes) -> None:
        """Implements asyncio.Protocol."""
        self._station._came(data)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002
        """Implements asyncio.Protocol."""
        self._station._lost(self)

    def pause_writing(self) -> None:
        """Implements asyncio.Protocol."""
        self.paused = True

    def resume_writing(self) -> None:
        """Implements asyncio.Protocol."""
        self.paused = False
        self._station._flush()
