"""Hardware in the loop: a PX4 at the other end of a serial line controls one UAV.

    bridges.open(Px4SerialBridge("/dev/ttyACM0"))  # hardware with SYS_HITL = 1

The messages are those of the TCP bridge. Hardware has its own clock and the simulation does not
wait for it, so that the simulation must run in real time; the simulation waits for a PX4 that uses
the simulator's time.
"""

from __future__ import annotations

import asyncio

from volery.core.errors import BridgeError
from volery.graph.session import Gateway
from volery.mavlink.codec import dialect
from volery.mavlink.hil.connection_notice import NOTICE_S, ConnectionNotice
from volery.mavlink.hil.lock_step import DEFAULT_TIMEOUT, TimeoutPolicy, uavs_with
from volery.mavlink.hil.session import HilSession
from volery.mavlink.links.serial_line import SerialLine

BAUD = 921600
"""HIL_SENSOR 250 times a second alone takes 190 kbit/s."""
_BEAT_S = 1.0
_MIN_BAUD = 230400


class Px4SerialBridge:
    """Serves the first UAV that no other autopilot bridge serves.

    path: of the device. baud: its speed. notice_s: wall time without a frame after which the bridge
    logs that the PX4 is missing; None: the caller reports it.
    """

    is_for_any_thread = False

    def __init__(
        self,
        path: str,
        baud: int = BAUD,
        *,
        timeout_policy: TimeoutPolicy = DEFAULT_TIMEOUT,
        notice_s: float | None = NOTICE_S,
    ) -> None:
        self._path, self._baud = path, baud
        self._timeout_policy = timeout_policy
        self._notice_s = notice_s
        self._absence: ConnectionNotice | None = None
        self._line: SerialLine | None = None
        self._session: HilSession | None = None
        self._beats: asyncio.Task[None] | None = None

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        return f"PX4 serial {self._path} at {self._baud} baud"

    @property
    def uav(self) -> str | None:
        """The UAV that it serves; None while the bridge is closed."""
        return None if self._session is None else self._session.uav

    async def start(self, gateway: Gateway) -> None:
        """Opens the line. Raises `BridgeError` if that fails or no UAV is left."""
        dialect()
        if self._baud < _MIN_BAUD:
            raise BridgeError(
                f"{self._path}: {self._baud} baud is too slow for HIL; use {_MIN_BAUD} or more"
            )
        uavs = uavs_with(gateway, "imu")
        flown = uavs_with(gateway, "rotor_speeds")
        free = [uav for uav in uavs if uav not in flown]
        if not free:
            raise BridgeError(f"{self._path}: no UAV with an IMU is left for a PX4 there")
        self._line = SerialLine(self._path, self._baud, self._take)
        self._session = HilSession(gateway, free[0], uavs.index(free[0]) + 1, self._timeout_policy)
        self._receive = self._session.take(self)
        self._beats = asyncio.create_task(self._beat())
        self._absence = ConnectionNotice("PX4", self._missing, _how_to_start, self._notice_s)

    async def stop(self) -> None:
        """Closes the line."""
        if self._absence is not None:
            self._absence.cancel()
        if self._beats is not None:
            self._beats.cancel()
            await asyncio.gather(self._beats, return_exceptions=True)
        if self._session is not None:
            self._session.close()
            self._session = None
        self.end()

    def send(self, data: bytes) -> bool:
        """Implements `HilConnection.send`: excess bytes follow later, or are lost."""
        if self._line is not None:
            self._line.send(data)
        return True

    def end(self) -> None:
        """Implements `HilConnection.end`."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def _take(self, data: bytes) -> None:
        if self._session is not None:
            self._receive(data)

    def _missing(self) -> dict[str, str]:
        """Returns the lines without frames, by UAV."""
        session = self._session
        if session is None or session.has_received:
            return {}
        return {session.uav: f"{self._path} at {self._baud} baud"}

    async def _beat(self) -> None:
        """Sends heartbeats, because PX4 opens its side only after the simulator's first frame."""
        while self._session is not None:
            self.send(self._session.heartbeat())
            await asyncio.sleep(_BEAT_S)


def _how_to_start() -> str:
    return "hardware there needs SYS_HITL = 1 and MAVLink at that speed (see docs/mavlink.md)"
