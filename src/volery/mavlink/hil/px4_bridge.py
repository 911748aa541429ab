"""Connects real PX4s to the UAVs: a TCP server for each vehicle, in lock step with the simulation.

    with Simulation(with_px4(scenario)) as simulation, BridgeHost(simulation.gateway) as bridges:
        bridges.open(Px4Bridge())      # 4560 + i; PX4 instances connect
        simulation.run(speed=1.0)

Every 4 ms of simulated time all PX4s receive their UAVs' sensor values, and the simulation waits
for those PX4s that have begun to answer. A PX4 that times out ends the run with an error or is
dropped, see `TimeoutPolicy`. A PX4 that disconnects may connect again, as a restarted one does. A
reset of the simulation disconnects all PX4s, because PX4 cannot go back in time.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
from collections.abc import Callable

from volery.core.errors import BridgeError
from volery.core.listener import Listener, open_listener
from volery.core.network_access import check_address, tend
from volery.core.preamble import Preamble
from volery.graph.session import Gateway
from volery.mavlink.codec import dialect
from volery.mavlink.hil.connection_notice import NOTICE_S, ConnectionNotice
from volery.mavlink.hil.lock_step import DEFAULT_TIMEOUT, TimeoutPolicy, uavs_with
from volery.mavlink.hil.px4_processes import MAX_INSTANCES
from volery.mavlink.hil.session import HilSession
from volery.mavlink.links.connection import why_not

PORT = 4560
_MAX_UNSENT_BYTES = 1 << 16
"""Largest number of unsent bytes for a PX4 that does not read, besides the kernel's buffers."""
_MAX_CONNECTIONS = 4
"""Connections to one UAV's port; all but one end as soon as the server sees them."""
_log = logging.getLogger(__name__)


class Px4Bridge:
    """Serves PX4 instance i, the autopilot of the i-th UAV, at `port` + i.

    port: 0 takes a free port for each UAV, see `ports`.
    notice_s: wall time after which missing PX4s are logged; None: the caller reports them.
    """

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = PORT,
        *,
        timeout_policy: TimeoutPolicy = DEFAULT_TIMEOUT,
        anywhere: bool = False,
        notice_s: float | None = NOTICE_S,
    ) -> None:
        self._host, self._port = host, port
        self._notice_s = notice_s
        self._absence: ConnectionNotice | None = None
        self._timeout_policy = timeout_policy
        self._anywhere = anywhere
        self._servers: list[asyncio.Server] = []
        self._ports: list[int] = []
        self._sessions: list[HilSession] = []

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        return f"PX4 {self._host}:{self._port} and following"

    @property
    def connected(self) -> tuple[str, ...]:
        """UAVs whose PX4 is connected."""
        return tuple(session.uav for session in self._sessions if session.is_connected)

    @property
    def ports(self) -> tuple[int, ...]:
        """Ports of the PX4s, in the order of the UAVs; empty while closed."""
        return tuple(self._ports)

    def address(self, number: int) -> str:
        """Returns the address to which instance `number` connects."""
        port = self._ports[number] if number < len(self._ports) else self._port + number
        return f"{self._host}:{port}"

    async def start(self, gateway: Gateway) -> None:
        """Starts listening. Raises `BridgeError` if a port is taken or a UAV lacks an IMU."""
        dialect()
        check_address(self._host, anywhere=self._anywhere, flag="--allow-remote")
        uavs = uavs_with(gateway, "imu")
        if not uavs:
            raise BridgeError("no UAV has the IMU that a PX4 needs")
        for k, uav in enumerate(uavs):
            session = HilSession(gateway, uav, k + 1, self._timeout_policy)
            self._sessions.append(session)
            await self._listen(session, self._port + k if self._port else 0)
        if self._notice_s is not None:
            self._absence = ConnectionNotice(
                "PX4", self._missing, lambda: how_to_start(len(uavs), self._port), self._notice_s
            )

    async def stop(self) -> None:
        """Disconnects all PX4s."""
        if self._absence is not None:
            self._absence.cancel()
        for server in self._servers:
            server.close()
        for session in self._sessions:
            session.close()
        self._servers.clear()
        self._ports.clear()
        self._sessions.clear()
        for _ in range(2):  # for connections to be aborted, and their callbacks to run
            await asyncio.sleep(0)

    def _missing(self) -> dict[str, str]:
        """Returns the addresses of the missing PX4s, by UAV."""
        return {
            session.uav: self.address(number)
            for number, session in enumerate(self._sessions)
            if not session.is_connected
        }

    async def _listen(self, session: HilSession, port: int) -> None:
        loop = asyncio.get_running_loop()
        try:
            listener = open_listener(
                self._host, port, f"{session.uav}: PX4", max_connections=_MAX_CONNECTIONS
            )
            server = await loop.create_server(lambda: _Connection(session, listener), sock=listener)
        except (OSError, OverflowError) as error:
            raise BridgeError(
                f"{session.uav}: cannot listen on {self._host}:{port}: {why_not(error)}"
            ) from None
        self._servers.append(server)
        self._ports.append(listener.getsockname()[1])


class _Connection(asyncio.Protocol):
    """One PX4's connection; a second one at the same port ends, or the first without a frame.

    The loop reads. The simulation's thread writes, on its own socket of the same connection, which
    avoids waiting for the loop to wake up.
    """

    is_for_any_thread = True
    _transport: asyncio.Transport
    _out: socket.socket | None = None

    def __init__(self, session: HilSession, listener: Listener) -> None:
        self._session = session
        self._listener = listener
        self._preamble = Preamble()
        self._loop = asyncio.get_running_loop()
        self._unsent = bytearray()
        self._receive: Callable[[bytes], None] = _ignore

    def send(self, data: bytes) -> bool:
        """Implements `HilConnection.send`; drops whole frames for a PX4 that does not read."""
        self._flush()
        if len(self._unsent) + len(data) > _MAX_UNSENT_BYTES:
            return False
        self._unsent += data
        self._flush()
        return not self._unsent

    def _flush(self) -> None:
        with contextlib.suppress(
            OSError
        ):  # no room now; or PX4 has disconnected, which the loop detects
            if self._unsent and self._out is not None:
                del self._unsent[: self._out.send(self._unsent)]

    def end(self) -> None:
        """Implements `HilConnection.end`."""
        self._receive = _ignore
        with contextlib.suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._transport.abort)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Implements asyncio's method."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        if self._session.is_connected and not self._session.has_received:
            self._session.end_unproven()
        if self._session.is_connected:
            uav = self._session.uav
            _log.warning("%s: its PX4 is connected already; another connection is closed", uav)
            transport.abort()
            return
        tend(transport.get_extra_info("socket"))
        self._out = transport.get_extra_info("socket").dup()
        self._receive = self._session.take(self)

    def data_received(self, data: bytes) -> None:
        """Implements asyncio's method."""
        data = self._preamble.feed(data)
        if self._preamble.refused is not None:
            self._listener.note_foreign_protocol(self._preamble.refused)
            self._transport.abort()
            return
        self._receive(data)
        if self._session.has_received:
            self._listener.prove(self._transport)

    def connection_lost(self, exc: Exception | None) -> None:  # noqa: ARG002
        """Implements asyncio's method."""
        if self._receive is not _ignore:
            self._session.leave("its PX4 has disconnected")
        if self._out is not None:
            self._out.close()


def how_to_start(count: int, port: int) -> str:
    """Returns the command that starts PX4s for `port` and following."""
    first = port - PORT
    if first < 0 or first + count > MAX_INSTANCES:
        return f"PX4's instances connect to ports {PORT} and following"
    shift = f" --first {first}" if first else ""
    return f"start with: volery px4 --px4-dir PX4-Autopilot --count {count}{shift}"


def _ignore(_data: bytes) -> None:
    """Ignores bytes of a connection without a session."""
