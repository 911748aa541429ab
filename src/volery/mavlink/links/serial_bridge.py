"""Carries all vehicles' MAVLink on a serial line to a radio or another program."""

from __future__ import annotations

import asyncio

from volery.graph.session import Gateway
from volery.mavlink.autopilot.messages.streams import GROUND
from volery.mavlink.codec import dialect
from volery.mavlink.links.connection import MavlinkConnection
from volery.mavlink.links.serial_line import SerialLine
from volery.mavlink.links.vehicle_registry import Sink, VehicleRegistry


class MavlinkSerial:
    """Serves all vehicles on one serial line: a radio, or a pseudo-terminal of another program.

    path: of the device. baud: its speed.
    """

    def __init__(self, path: str, baud: int = 57600, *, key: bytes | None = None) -> None:
        self._key = key
        self._path, self._baud = path, baud
        self._fleet: VehicleRegistry | None = None
        self._looks: asyncio.Task[None] | None = None
        self._line: SerialLine | None = None
        self._connection: MavlinkConnection | None = None

    @property
    def name(self) -> str:
        """Name and address of the bridge."""
        return f"MAVLink serial {self._path} at {self._baud} baud"

    async def start(self, gateway: Gateway) -> None:
        """Opens the line. Raises `BridgeError` if that fails."""
        dialect()
        self._line = SerialLine(self._path, self._baud, self._take)
        self._fleet = VehicleRegistry(gateway, self.name, self._join, lambda _system: None)
        self._connection = MavlinkConnection(self._fleet, self._line.number, GROUND, self._key)
        self._fleet.look()
        self._looks = asyncio.create_task(self._fleet.look_periodically())

    async def stop(self) -> None:
        """Closes the line."""
        if self._looks is not None:
            self._looks.cancel()
            await asyncio.gather(self._looks, return_exceptions=True)
        if self._connection is not None:
            self._connection.leave()
        if self._fleet is not None:
            self._fleet.close()
        if self._line is not None:
            self._line.close()

    def _join(self, _name: str, system: int) -> Sink:
        assert self._connection is not None
        assert self._line is not None
        self._connection.greet(system)
        line, connection = self._line, self._connection

        def sink(number: int, data: bytes) -> None:
            if number in (-1, connection.number):
                line.send(connection.sign(data))

        return sink

    def _take(self, data: bytes) -> None:
        if self._connection is not None:
            self._connection.take(data)
