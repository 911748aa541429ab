"""Manages the UAVs of a running simulation with their sensors, commands and nodes."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from volery.comms.radio.network import RadioNetwork
from volery.control.fleet import Fleet
from volery.core.arrays import Array
from volery.core.errors import CommandError, PlacementError
from volery.engine.engine import Engine
from volery.engine.events import Event
from volery.engine.faults import FaultPlan
from volery.engine.sensor_restart import NamedStreams
from volery.graph.graph import Graph
from volery.graph.nodes.node import Node
from volery.publishing.graph_publisher import GraphPublisher
from volery.runtime.build.assembly import Assembly, assemble
from volery.runtime.build.graph import announce_sensors, start_nodes, start_system_nodes
from volery.runtime.build.placement import StartPose, check_room
from volery.runtime.build.sensor_suites import SensorInstance, refit
from volery.runtime.conditional_runs import ConditionalRuns
from volery.runtime.monitoring.output_sink import OutputSink
from volery.runtime.services.results import Close
from volery.runtime.services.uav_services import offer_uav_services
from volery.runtime.vehicles.battery_failsafe import BatteryFailsafe
from volery.runtime.vehicles.command_interface import open_commands
from volery.runtime.vehicles.external_odometry import ExternalOdometry
from volery.runtime.vehicles.flight_futures import CHECK_PERIOD_S, FlightFutures
from volery.runtime.vehicles.flight_states import FlightStates
from volery.runtime.vehicles.uav import Uav
from volery.runtime.vehicles.uav_sensors import UavSensors
from volery.runtime.vehicles.uav_table import UavTable
from volery.scenario.schema import Scenario, Sensor
from volery.sensors.cameras.camera import EVERY_PART, Part
from volery.sensors.samples import SensorId
from volery.vehicle.airframe import Airframe
from volery.world.terrain import Terrain

_ROOT = "/"
"""Namespace of the nodes of the whole system."""


@dataclass
class InitialState:
    """Initial state of a UAV: its row in the state of a fleet before the first step."""

    fleet: dict[str, Any]
    row: int


@dataclass
class VehicleManager:
    """Manages the UAVs of an engine: starts, sensors, handles, commands on the graph, nodes.

    `open(parts)` creates the first UAVs; `regroup(starts)` replaces them, and UAVs present before
    and after continue undisturbed.
    """

    scenario: Scenario
    """Scenario with every type that can be spawned."""
    engine: Engine
    graph: Graph
    publisher: GraphPublisher
    outlet: OutputSink
    faults: FaultPlan
    starts: tuple[StartPose, ...]
    """Start poses, in fleet order."""
    terrain: Terrain
    runs: ConditionalRuns
    """Runs for code that waits for flight commands and samples."""
    radio: RadioNetwork | None = None
    fitted: list[SensorInstance] = field(default_factory=list)
    uavs: UavTable = field(default_factory=UavTable)
    nodes: list[Node] = field(default_factory=list)
    """Nodes in fleet order, then those of the whole system."""
    beginnings: dict[str, InitialState] = field(default_factory=dict)
    flight_states: FlightStates = field(init=False)
    pose_aids: ExternalOdometry = field(init=False)
    futures: FlightFutures = field(init=False)
    """Futures of the UAVs' flight commands."""
    _battery_failsafe: BatteryFailsafe = field(init=False)
    _closes: dict[str, list[Close]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        origin = self.scenario.world.origin
        self.pose_aids = ExternalOdometry(self.graph, self.engine)
        self.flight_states = FlightStates(self.graph, self.engine, origin)
        self.futures = FlightFutures(self._fleet_row_of, self.runs)
        self._battery_failsafe = BatteryFailsafe(self.engine, self.uavs.get)
        self.outlet.on_event = self._on_event

    def open(self, parts: Assembly) -> None:
        """Connects the engine's first UAVs to the graph."""
        self.flight_states.start(self.engine.every)
        self.pose_aids.start(self.engine.every)
        futures = self.futures
        self.engine.every(CHECK_PERIOD_S, futures.check, wanted=lambda: futures.needs_checks)
        self._take_over(parts, self.starts)
        self.start_nodes()

    def regroup(self, starts: Sequence[StartPose]) -> None:
        """Replaces the UAVs by `starts`; call `start_nodes` for the nodes of new UAVs."""
        if not self.engine.stands:
            raise CommandError("UAVs are spawned and deleted between ticks; use post()")
        if not starts:
            raise CommandError("a simulation needs at least one UAV")
        parts = assemble(self.scenario, starts, self.engine.scene)
        new = [start for start in starts if start not in self.starts]
        going_on = {start.name for start in starts if start in self.starts}
        for start in self.starts:
            if start.name not in going_on:
                self._dismiss(start.name)
        self.starts = tuple(starts)
        self._take_over(parts, new, going_on)

    def start_nodes(self) -> None:
        """Starts the nodes of UAVs without nodes, and those of the system if none runs."""
        served = {node.get_namespace() for node in self.nodes}
        alone = [start for start in self.starts if f"/{start.name}" not in served]
        now_ns = self._now_ns
        self.nodes += start_nodes(self.scenario, alone, self.graph, self.engine, now_ns)
        if _ROOT not in served:
            self.nodes += start_system_nodes(self.scenario, self.graph, self.engine, now_ns)
        order = {f"/{start.name}": row for row, start in enumerate(self.starts)}
        self.nodes.sort(key=lambda node: order.get(node.get_namespace(), len(order)))

    def take_off(self, names: Iterable[str]) -> None:
        """Takes off with those of the UAVs that start with a take-off."""
        chosen = set(names)
        for start in self.starts:
            if start.takes_off and start.name in chosen:
                self.uavs[start.name].take_off()

    def reseed(self, seed: int) -> None:
        """Uses the random streams of `seed` for sensors that restart and UAVs that are spawned."""
        if seed != self.scenario.seed:
            self.scenario = self.scenario.model_copy(update={"seed": seed})
            self.fitted = refit(self.fitted, seed)

    def restart_nodes(self, name: str) -> None:
        """Constructs the nodes of one UAV again."""
        self._end_nodes_of(name)
        self.start_nodes()

    def end_nodes(self) -> None:
        """Destroys all nodes."""
        while self.nodes:
            self.nodes.pop().destroy_node()

    # -------------------------------------------------------------------------------- inside

    def _take_over(
        self, parts: Assembly, new: Sequence[StartPose], going_on: set[str] | None = None
    ) -> None:
        names = tuple(start.name for start in self.starts)
        begun = parts.fleet.get_state()
        if going_on is not None:
            self.engine.regroup(parts.fleet, parts.banks, names, parts.estimation, going_on)
            self.outlet.fleet = parts.fleet
        self.fitted = parts.fitted
        fresh = {start.name for start in new}
        announce_sensors(self.publisher, [f for f in self.fitted if f.id.uav_name in fresh])
        self.publisher.arrange(names)
        self.outlet.latest.arrange(parts.banks, self.fitted)
        for bank in parts.banks:
            if bank.name == "camera":
                cameras: Any = bank
                cameras.bank.requested_parts = partial(self._requested_parts, bank.sensors)
                self.publisher.cameras.set_size(bank.sensors, cameras.bank.pixels)
        for row, start in enumerate(self.starts):
            if start.name in fresh:
                self.beginnings[start.name] = InitialState(begun, row)
                self._enlist(start, row)
            else:
                self.uavs[start.name].move_to((parts.fleet, row))
        self.uavs.update({name: self.uavs.pop(name) for name in names})  # in fleet order
        if going_on is not None:
            self.faults.enlist(fresh)
            self._restart_sensors(fresh)

    def _enlist(self, start: StartPose, row: int) -> None:
        flight = self.scenario.types[start.type_name].flight
        uav = self.uavs[start.name] = Uav(
            self.engine.fleet,
            row,
            start.name,
            flight,
            start.type_name,
            self._check_goal,
            sensors=UavSensors(self.outlet.latest, self.runs, start.name),
            futures=self.futures,
        )
        closes = self._closes[start.name] = [
            *open_commands(self.graph, uav, self._now_ns),
            *offer_uav_services(self.graph, uav),
            *self.flight_states.open(uav),
            *self.pose_aids.open(start.name, self._sensors_of(start)),
        ]
        if self.radio is not None and self.scenario.types[start.type_name].radio:
            closes.append(self.radio.join(start.name))

    def _requested_parts(self, cameras: Sequence[SensorId]) -> Collection[Part]:
        """Returns the parts of these cameras' images that have receivers."""
        if self.outlet.latest.requests(cameras):
            return EVERY_PART
        return self.publisher.cameras.subscribed_parts(cameras)

    def _on_event(self, event: Event) -> None:
        self.futures.happened(event)
        self._battery_failsafe.happened(event, self.scenario)

    def _fleet_row_of(self, name: str) -> tuple[Fleet, int]:
        if name not in self.uavs:
            raise CommandError(f"{name} was deleted")
        return self.uavs[name].fleet_row

    def _check_goal(self, position: Array, airframe: Airframe) -> None:
        """Raises `CommandError` if a goal is below the ground or inside an obstacle."""
        at = ", ".join(f"{coordinate:.2f}" for coordinate in position)
        scene, terrain = self.engine.scene, self.terrain
        try:
            check_room(position, airframe, scene, terrain, f"the goal ({at}) m")
        except PlacementError as error:
            raise CommandError(str(error)) from None

    def _sensors_of(self, start: StartPose) -> Sequence[Sensor]:
        return self.scenario.types[start.type_name].sensors

    def _dismiss(self, name: str) -> None:
        self._end_nodes_of(name)
        for close in self._closes.pop(name):
            close()
        self.publisher.retire(name)
        self.outlet.latest.forget(name)
        self.futures.fail(name, "the UAV was deleted")
        self.uavs.pop(name).move_to(None)
        del self.beginnings[name]

    def _end_nodes_of(self, name: str) -> None:
        for node in [node for node in self.nodes if node.get_namespace() == f"/{name}"]:
            node.destroy_node()
            self.nodes.remove(node)

    def _restart_sensors(self, fresh: set[str]) -> None:
        keys = {(f.id.uav, f.id.name): f.key for f in self.fitted if f.id.uav_name in fresh}
        rows = [row for row, start in enumerate(self.starts) if start.name in fresh]
        self.engine.restart_sensors(np.array(rows, np.int64), NamedStreams(keys))

    def _now_ns(self) -> int:
        return self.engine.time_ns
