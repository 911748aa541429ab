"""The autopilot of one UAV: receives MAVLink frames and flight states, returns frames and commands.

    autopilot = Autopilot(1, vehicle, build)
    autopilot.receive(link=0, profile=ONBOARD, data=frames, now_ns=...)
    autopilot.update(state)       # a hundred times a simulated second
    for link, data in autopilot.take_sent(): ...

The behaviour depends only on the inputs and their simulated time, so that a recorded flight
repeats. The state is in `memory`.
"""

from __future__ import annotations

import math
from typing import Any

from volery.core.errors import CommandError
from volery.mavlink.autopilot import (
    calibration,
    failsafes,
    flight_tasks,
    message_handlers,
    mode_transitions,
    streams,
)
from volery.mavlink.autopilot.flight_log import FlightLog
from volery.mavlink.autopilot.geo_reference import GeoReference
from volery.mavlink.autopilot.mission_protocol import keep_transfers_going
from volery.mavlink.autopilot.parameters import Value, refusal
from volery.mavlink.autopilot.state import AutopilotState, LinkState, Source
from volery.mavlink.autopilot.telemetry import HEARTBEAT, status_texts
from volery.mavlink.autopilot.vehicle import FlightState, Vector, Vehicle, VehicleInfo
from volery.mavlink.codec import AUTOPILOT, Codec, Parser, dialect
from volery.mavlink.framing import Framer

ALL_LINKS = 65535
MOST_LINKS = 64
"""Links of one vehicle; frames of further links are ignored (modelling choice)."""
INFO, WARNING, CRITICAL, EMERGENCY = 6, 4, 2, 0
"""Values of MAV_SEVERITY."""


class Autopilot:
    """A PX4-like vehicle with a system id from 1 to 250."""

    def __init__(
        self,
        system: int,
        vehicle: Vehicle,
        build: VehicleInfo,
        parameters: dict[str, Value] | None = None,
    ) -> None:
        self.system = system
        self.vehicle = vehicle
        self.build = build
        self.earth = GeoReference(*build.origin)
        self.memory = AutopilotState()
        self.log = FlightLog()
        self._codec = Codec(system)
        self._parser = Parser()
        self._framer = Framer()
        self._sent: list[tuple[int, bytes]] = []
        self._place: tuple[int, Vector] = (-1, (0.0, 0.0, 0.0))
        self._set_up(parameters or {})

    # ------------------------------------------------------------------------------------- links

    def receive(self, link: int, profile: int, data: bytes, now_ns: int) -> None:
        """Handles whole frames of a link; the first frames open a link."""
        memory = self.memory
        memory.now_ns = now_ns
        if link not in memory.links:
            if len(memory.links) >= MOST_LINKS:
                return
            memory.links[link] = streams.begin(LinkState(link, profile), now_ns)
        for frame in self._framer.datagram(data):
            own = (frame.system, frame.component) == (self.system, AUTOPILOT)
            message = None if own else self._parser.decode(frame.data)
            if message is not None:
                self._take(link, message)

    def close_link(self, number: int) -> None:
        """Removes a link."""
        self.memory.links.pop(number, None)
        self.log.transfers.forget(number)

    def send(self, message: Any, link: int = ALL_LINKS) -> None:
        """Sends a message on one link, or on all links."""
        links = self.memory.links
        chosen = links.values() if link == ALL_LINKS else filter(None, [links.get(link)])
        for one in chosen:
            self._sent.append((one.number, self._codec.pack(message, one.sequence)))
            one.sequence = (one.sequence + 1) % 256

    def send_payload(self, number: int, payload: bytes, link: int) -> None:
        """Sends the packed fields of a message on one link; for messages sent by the thousand."""
        one = self.memory.links.get(link)
        if one is not None:
            self._sent.append((link, self._codec.frame(number, payload, one.sequence)))
            one.sequence = (one.sequence + 1) % 256

    def say(self, severity: int, text: str) -> None:
        """Sends a status text to all links and logs it."""
        self.log.note(self, severity, text)
        for message in status_texts(severity, text):
            self.send(message)

    def take_sent(self) -> list[tuple[int, bytes]]:
        """Returns the frames sent since the last call, with their links."""
        sent, self._sent = self._sent, []
        return sent

    # ------------------------------------------------------------------------------------ flight

    def update(self, state: FlightState) -> None:
        """Updates the flight with a new state of the UAV, and sends what is due."""
        memory = self.memory
        memory.now_ns = state.time_ns
        first = memory.state is None
        memory.state = state
        if first:
            memory.origin = memory.home = state.position
        if not (memory.has_receiver or memory.fix_denied):
            memory.fix_ns = state.time_ns
        mode_transitions.follow_vehicle(self, state)
        if state.time_ns >= memory.next_check_ns:
            memory.next_check_ns = state.time_ns + failsafes.PERIOD_NS
            failsafes.check(self, state)
            keep_transfers_going(self)
            calibration.update(self)
        flight_tasks.fly(self, state)
        self.log.update(self)
        streams.send_due(self)
        self.log.transfers.send_some(self)

    def announce(self) -> None:
        """Reports a change of mode at once."""
        self.send(HEARTBEAT(self))

    # ---------------------------------------------------------------------------- derived values

    @property
    def state(self) -> FlightState:
        """Newest state of the UAV. Raises `CommandError` before the first one."""
        if self.memory.state is None:
            raise CommandError("no state of the UAV received yet")
        return self.memory.state

    @property
    def yaw(self) -> float:
        """Yaw in the map, rad."""
        x, y, z, w = self.state.attitude
        return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))

    def geodetic(self) -> Vector:
        """Returns latitude, longitude, degrees, and altitude, m; computed once per state."""
        time_ns, place = self._place
        if time_ns != self.state.time_ns:
            place = self.earth.geodetic(self.state.position)
            self._place = self.state.time_ns, place
        return place

    def parameter(self, name: str) -> Value:
        """Returns the value of a parameter."""
        return self.memory.parameters[name]

    # ------------------------------------------------------------------------------------ inside

    def _set_up(self, given: dict[str, Value]) -> None:
        values = self.memory.parameters
        values["MAV_SYS_ID"] = self.system
        values["MAV_TYPE"] = {4: 2, 6: 13, 8: 14}.get(self.build.rotors, 2)
        values["MPC_THR_HOVER"] = self.build.hover_thrust
        values["MPC_XY_VEL_MAX"] = min(float(values["MPC_XY_VEL_MAX"]), self.build.speed)
        for name, value in given.items():
            why = refusal(name, value)
            if why:
                raise CommandError(why)
            values[name] = type(values[name])(value)

    def _take(self, link: int, message: Any) -> None:
        kind = message.get_type()
        handler = message_handlers.HANDLERS.get(kind)
        if handler is None or not self._is_meant(message):
            return
        source: Source = (link, message.get_srcSystem(), message.get_srcComponent())
        try:
            handler(self, source, message)
        except CommandError:
            return  # the request was answered before; a refused setpoint is not flown

    def _is_meant(self, message: Any) -> bool:
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in (0, self.system) and component in (0, AUTOPILOT)


def message_class(name: str) -> Any:
    """Returns pymavlink's class of a message by its name."""
    return getattr(dialect(), f"MAVLink_{name.lower()}_message")
