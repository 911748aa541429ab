"""What flight tasks and message handlers share: the autopilot's state, its UAV and its clients."""

from __future__ import annotations

import math

from volery.core.errors import CommandError
from volery.mavlink.autopilot.client_links import ClientLinks
from volery.mavlink.autopilot.geo_reference import GeoReference
from volery.mavlink.autopilot.logs.flight_log import FlightLog
from volery.mavlink.autopilot.messages.status_messages import heartbeat, status_texts
from volery.mavlink.autopilot.parameters import Value, refusal
from volery.mavlink.autopilot.state import AutopilotState
from volery.mavlink.autopilot.vehicle import FlightState, Vector, Vehicle, VehicleInfo

_REFUSAL_PERIOD_NS = 1_000_000_000
"""Time between two equal reports (modelling choice): setpoints arrive fifty times a second."""


class AutopilotContext:
    """Holds the state of one autopilot, commands its UAV and sends to its clients."""

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
        self.links = ClientLinks(system)
        self.log = FlightLog(self.links, lambda problem: self.report(4, problem))
        self._geodetic: tuple[int, Vector] = (-1, (0.0, 0.0, 0.0))
        self._set_parameters(parameters or {})

    def report(self, severity: int, text: str) -> None:
        """Sends a status text to all links and logs it. severity: a MAV_SEVERITY."""
        self.log.note(self.memory.now_ns, severity, text)
        self.memory.text_number = self.memory.text_number % 65535 + 1
        for message in status_texts(severity, text, self.memory.text_number):
            self.links.send(message)

    def report_refusal(self, text: str) -> None:
        """Reports why a message without a response is refused, each text at most once a second."""
        times_ns, now_ns = self.memory.reported_refusals, self.memory.now_ns
        if now_ns - times_ns.get(text, -_REFUSAL_PERIOD_NS) < _REFUSAL_PERIOD_NS:
            return
        for old in [
            known for known, time_ns in times_ns.items() if now_ns - time_ns >= _REFUSAL_PERIOD_NS
        ]:
            del times_ns[old]
        times_ns[text] = now_ns
        self.report(2, text)

    def announce(self) -> None:
        """Reports a change of mode at once."""
        self.links.send(heartbeat(self.memory))

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
        time_ns, position = self._geodetic
        if time_ns != self.state.time_ns:
            position = self.earth.geodetic(self.state.position)
            self._geodetic = self.state.time_ns, position
        return position

    def parameter(self, name: str) -> Value:
        """Returns the value of a parameter."""
        return self.memory.parameters[name]

    def _set_parameters(self, given: dict[str, Value]) -> None:
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
