"""Hardware in the loop: one UAV is flown by a PX4 at the other end of a serial line.

    bridges.open(Px4Serial("/dev/ttyACM0"))        # hardware with SYS_HITL = 1

The same messages as over TCP. Hardware has a clock of its own and is not waited for, so that the
simulation must run in real time; a PX4 that takes its time from the simulator is waited for.
"""

from __future__ import annotations

import asyncio

from volery.core.errors import BridgeError
from volery.graph.session import Gateway
from volery.mavlink.codec import dialect
from volery.mavlink.hil.connection_notice import NOTICE_S, ConnectionNotice
from volery.mavlink.hil.lock_step import PATIENCE, TimeoutPolicy, uavs_with
from volery.mavlink.hil.session import HilSession
from volery.mavlink.links.serial_line import SerialLine

BAUD = 921600
"""HIL_SENSOR 250 times a second alone takes 190 kbit/s."""
_BEAT_S = 1.0
_LEAST_BAUD = 230400


class Px4SerialBridge:
    """Serves the first UAV that no other autopilot bridge serves.

    path: of the device. baud: its speed. notice_s: wall time after which it is said that nothing is
    heard there; None: the caller says so.
    """

    is_for_any_thread = False

    def __init__(
        self,
        path: str,
        baud: int = BAUD,
        *,
        patience: TimeoutPolicy = PATIENCE,
        notice_s: float | None = NOTICE_S,
    ) -> None:
        self._path, self._baud = path, baud
        self._patience = patience
        self._notice_s = notice_s
        self._absence: ConnectionNotice | None = None
        self._line: SerialLine | None = None
        self._seat: HilSession | None = None
        self._beats: asyncio.Task[None] | None = None

    @property
    def name(self) -> str:
        """What it is and where."""
        return f"PX4 serial {self._path} at {self._baud} baud"

    @property
    def uav(self) -> str | None:
        """The UAV that it serves; None while it is closed."""
        return None if self._seat is None else self._seat.uav

    async def start(self, gateway: Gateway) -> None:
        """Open the line. `BridgeError` where that is not possible, or no UAV is left."""
        dialect()
        if self._baud < _LEAST_BAUD:
            raise BridgeError(
                f"{self._path}: {self._baud} baud is too slow for HIL; {_LEAST_BAUD} or more"
            )
        uavs = uavs_with(gateway, "imu")
        flown = uavs_with(gateway, "rotor_speeds")
        free = [uav for uav in uavs if uav not in flown]
        if not free:
            raise BridgeError(f"{self._path}: no UAV with an IMU is left for a PX4 there")
        self._line = SerialLine(self._path, self._baud, self._take)
        self._seat = HilSession(gateway, free[0], uavs.index(free[0]) + 1, self._patience)
        self._hear = self._seat.take(self)
        self._beats = asyncio.create_task(self._beat())
        self._absence = ConnectionNotice("PX4", self._missing, _how_to_start, self._notice_s)

    async def stop(self) -> None:
        """Close the line."""
        if self._absence is not None:
            self._absence.cancel()
        if self._beats is not None:
            self._beats.cancel()
            await asyncio.gather(self._beats, return_exceptions=True)
        if self._seat is not None:
            self._seat.close()
            self._seat = None
        self.end()

    def send(self, data: bytes) -> bool:
        """As of `Way`: what does not fit on the line now follows, or is lost."""
        if self._line is not None:
            self._line.send(data)
        return True

    def end(self) -> None:
        """As of `Way`."""
        if self._line is not None:
            self._line.close()
            self._line = None

    def _take(self, data: bytes) -> None:
        if self._seat is not None:
            self._hear(data)

    def _missing(self) -> dict[str, str]:
        """Where nothing is heard, by UAV."""
        seat = self._seat
        if seat is None or seat.has_heard:
            return {}
        return {seat.uav: f"{self._path} at {self._baud} baud"}

    async def _beat(self) -> None:
        """PX4 opens its side for the simulator that it hears."""
        while self._seat is not None:
            self.send(self._seat.heartbeat())
            await asyncio.sleep(_BEAT_S)


def _how_to_start() -> str:
    return "hardware there needs SYS_HITL = 1 and MAVLink at that speed (see docs/mavlink.md)"
