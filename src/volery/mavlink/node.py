"""Runs the autopilot as a node of the simulation: in lock step with its UAV, so that runs repeat.

    [[types.iris.nodes]]
    node = "mavlink_autopilot"
    parameters = { px4 = { MIS_TAKEOFF_ALT = 5.0 } }

The node subscribes to frames on `mavlink/in` and publishes frames on `mavlink/out`; `udp_bridge`,
`tcp_bridge` and `serial_bridge` carry them. It also has MAVROS's topics and services below
`mavros/`, and for system 1 below `/mavros/` too.
"""

from __future__ import annotations

import re
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from volery.core.errors import NodeError
from volery.graph.messages import FluidPressure, NavSatFix, Temperature, message_type
from volery.graph.nodes.node import Node
from volery.mavlink.autopilot import core
from volery.mavlink.autopilot.graph_vehicle import GraphVehicle, build_of, state_of
from volery.mavlink.autopilot.messages import streams
from volery.mavlink.autopilot.protocols.log_transfer import TransferRate
from volery.mavlink.autopilot.state import AutopilotState
from volery.mavlink.mavros import Mavros

PACKETS = "volery_interfaces/msg/MavlinkPackets"
_STATE = "volery_interfaces/msg/FlightState"
_PACES: WeakKeyDictionary[Any, TransferRate] = WeakKeyDictionary()
"""Transfer pace of the vehicles of each graph, which share it."""
MAX_SYSTEMS = 250
"""Largest system id of a vehicle; ids above are ground stations' by convention."""


class AutopilotNode(Node):
    """Runs a PX4-like autopilot.

    Parameters: `system_id` (0: N for uavN; for other names the highest free id), `px4`: values of
    the autopilot's parameters by name, see docs/mavlink.md.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("autopilot", **options)
        wanted = int(self.declare_parameter("system_id", 0).value)
        given = self.declare_parameter("px4", {}).value
        self.system_id = wanted or self._own_number() or self._free_number()
        if not 1 <= self.system_id <= MAX_SYSTEMS:
            raise NodeError(f"system_id {self.system_id}: must be 1 to {MAX_SYSTEMS}")
        self.declare_parameter("mavlink_id", self.system_id)
        build = build_of(self)
        self.core = core.Autopilot(self.system_id, GraphVehicle(self), build, given)
        context = self.core.context
        context.log.transfers.pace = _PACES.setdefault(self._context.graph, TransferRate())
        self._packets = message_type(PACKETS)
        self._out = self.create_publisher(self._packets, "mavlink/out", 1000)
        self._mavros = [Mavros(self, context, "mavros")]
        if self.system_id == 1:
            self._mavros.append(Mavros(self, context, "/mavros"))
        self.create_subscription(self._packets, "mavlink/in", self._take, 1000)
        self.create_subscription(message_type(_STATE), "flight_state", self._fly, 1)
        self.create_subscription(NavSatFix, "fix", self._take_fix, 1)
        self.create_subscription(FluidPressure, "pressure", self._take_pressure, 1)
        self.create_subscription(Temperature, "pressure/temperature", self._take_temperature, 1)

    def get_state(self) -> AutopilotState:
        """Returns the whole state, without links: they belong to the bridges."""
        return self.core.context.memory

    def set_state(self, state: AutopilotState) -> None:
        """Restores a saved state, with the current links."""
        context = self.core.context
        context.memory = state
        context.log.end()
        for link in context.links.open.values():
            streams.begin(link, state.now_ns)

    def destroy_node(self) -> None:
        """Destroys the node and closes the flight logs."""
        super().destroy_node()
        self.core.context.log.close()

    def _take(self, message: Any) -> None:
        if message.closed:
            self.core.close_link(message.link)
            return
        data = np.asarray(message.data, np.uint8).tobytes()
        self.core.receive(message.link, message.profile, data, self.get_clock().now_ns())
        self._flush()

    def _fly(self, message: Any) -> None:
        self.core.update(state_of(message))
        for mavros in self._mavros:
            mavros.publish()
        self._flush()

    def _take_fix(self, fix: Any) -> None:
        memory = self.core.context.memory
        memory.has_receiver = True
        if fix.status.status >= 0:
            memory.fix_ns = self.get_clock().now_ns()

    def _take_pressure(self, pressure: Any) -> None:
        self.core.context.memory.pressure = float(pressure.fluid_pressure)

    def _take_temperature(self, temperature: Any) -> None:
        self.core.context.memory.air_temperature = float(temperature.temperature)

    def _flush(self) -> None:
        """Publishes the pending frames, one message per link."""
        frames: dict[int, list[bytes]] = {}
        for link, data in self.core.take_sent():
            frames.setdefault(link, []).append(data)
        for link, parts in frames.items():
            joined = np.frombuffer(b"".join(parts), np.uint8)
            self._out.publish(self._packets(link=link, profile=0, closed=False, data=joined))

    def _own_number(self) -> int:
        """Returns N for uavN; 0 for other names."""
        found = re.fullmatch(r"/uav([1-9]\d{0,2})", self.get_namespace())
        return int(found[1]) if found and int(found[1]) <= MAX_SYSTEMS else 0

    def _free_number(self) -> int:
        """Returns the highest id that no other autopilot of the graph has."""
        parameters = self._context.graph.parameters
        used = {
            parameters.get(node, name).value
            for node, name in parameters.names()
            if name == "mavlink_id"
        }
        return next(n for n in range(MAX_SYSTEMS, 0, -1) if n not in used)
