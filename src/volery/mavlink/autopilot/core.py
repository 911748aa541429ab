"""The autopilot of one UAV: receives MAVLink frames and flight states, returns frames and commands.

    autopilot = Autopilot(1, vehicle, build)
    autopilot.receive(link=0, profile=ONBOARD, data=frames, now_ns=...)
    autopilot.update(state)       # a hundred times a simulated second
    for link, data in autopilot.take_sent(): ...

The behaviour depends only on the inputs and their simulated time, so that a recorded flight
repeats. The state is in `context.memory`.
"""

from __future__ import annotations

from typing import Any

from volery.core.errors import CommandError
from volery.mavlink.autopilot.client_links import MAX_LINKS, LinkState
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.logs.flight_logger import FlightLogger
from volery.mavlink.autopilot.messages import streams
from volery.mavlink.autopilot.modes import flight_tasks, mode_transitions
from volery.mavlink.autopilot.parameters import Value
from volery.mavlink.autopilot.protocols import calibration, message_handlers, requests
from volery.mavlink.autopilot.protocols.mission_protocol import update_transfers
from volery.mavlink.autopilot.safety import failsafes
from volery.mavlink.autopilot.state import Source
from volery.mavlink.autopilot.vehicle import FlightState, Vehicle, VehicleInfo
from volery.mavlink.codec import AUTOPILOT, Parser
from volery.mavlink.framing import Framer

_COMMANDS, _FOR_ONE = ("COMMAND_LONG", "COMMAND_INT"), ("COMMAND_", "MISSION_", "PARAM_")
_PLANNER = 190
"""Component MAV_COMP_ID_MISSIONPLANNER, to which plans may be sent."""


class Autopilot:
    """A PX4-like vehicle with a system id from 1 to 250."""

    def __init__(
        self,
        system: int,
        vehicle: Vehicle,
        build: VehicleInfo,
        parameters: dict[str, Value] | None = None,
    ) -> None:
        self.context = AutopilotContext(system, vehicle, build, parameters)
        self._logger = FlightLogger(self.context)
        self._parser = Parser()
        self._framer = Framer()

    def receive(self, link: int, profile: int, data: bytes, now_ns: int) -> None:
        """Handles whole frames of a link; the first frames open a link."""
        links = self.context.links.open
        self.context.memory.now_ns = now_ns
        if link not in links:
            if len(links) >= MAX_LINKS:
                return
            links[link] = streams.begin(LinkState(link, profile), now_ns)
        for frame in self._framer.datagram(data):
            own = (frame.system, frame.component) == (self.context.system, AUTOPILOT)
            message = None if own else self._parser.decode(frame.data)
            if message is not None:
                self._take(link, message)

    def close_link(self, number: int) -> None:
        """Removes a link."""
        self.context.links.open.pop(number, None)
        self.context.log.transfers.forget(number)

    def take_sent(self) -> list[tuple[int, bytes]]:
        """Returns the frames sent since the last call, with their links."""
        return self.context.links.take_sent()

    def update(self, state: FlightState) -> None:
        """Updates the flight with a new state of the UAV, and sends what is due."""
        context, memory = self.context, self.context.memory
        memory.now_ns = state.time_ns
        first = memory.state is None
        memory.state = state
        if first:
            memory.origin = memory.home = state.position
        if not (memory.has_receiver or memory.fix_denied):
            memory.fix_ns = state.time_ns
        mode_transitions.follow_vehicle(context, state)
        if state.time_ns >= memory.next_check_ns:
            memory.next_check_ns = state.time_ns + failsafes.PERIOD_NS
            failsafes.check(context, state)
            update_transfers(context)
            calibration.update(context)
        flight_tasks.fly(context, state)
        self._logger.update()
        streams.send_due(context)
        context.log.transfers.send_some(memory.now_ns)

    def _take(self, link: int, message: Any) -> None:
        kind = message.get_type()
        handler = message_handlers.HANDLERS.get(kind)
        if handler is None or not self._is_meant(message):
            return
        source: Source = (link, message.get_srcSystem(), message.get_srcComponent())
        try:
            handler(self.context, source, message)
        except CommandError:
            return  # the request was answered before; a refused setpoint is not flown

    def _is_meant(self, message: Any) -> bool:
        """Returns whether a message is for this vehicle.

        As in PX4, commands, plans and parameters name the vehicle; the others may be for all.
        """
        kind = message.get_type()
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        if kind in _COMMANDS and message.command in requests.FOR_ALL:
            return system in (0, self.context.system)
        if system == 0 and kind.startswith(_FOR_ONE):
            self.context.report_refusal(
                f"{kind} to system 0 ignored: this one is {self.context.system}"
            )
            return False
        planner = _PLANNER if kind.startswith("MISSION_") else AUTOPILOT
        return system in (0, self.context.system) and component in (0, AUTOPILOT, planner)
