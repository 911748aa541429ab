"""Manages the UAVs of a running simulation with their sensors, commands and nodes."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from volery.comms.radio.network import RadioNetwork
from volery.control.fleet import Fleet
from volery.core.arrays import Array
from volery.core.errors import CommandError, PlacementError
from volery.core.undo_steps import UndoSteps
from volery.engine.engine import Engine
from volery.engine.events import Event
from volery.engine.faults import FaultPlan
from volery.engine.sensor_restart import NamedStreams
from volery.graph.graph import Graph
from volery.graph.nodes.node import Node
from volery.publishing.graph_publisher import GraphPublisher
from volery.runtime.conditional_runs import ConditionalRuns
from volery.runtime.construction.assembly import Assembly, assemble
from volery.runtime.construction.fleet import add_bodies
from volery.runtime.construction.graph import announce_sensors, start_nodes, start_system_nodes
from volery.runtime.construction.partition import WHOLE, Partition
from volery.runtime.construction.placement import StartPose, check_room
from volery.runtime.construction.sensor_suites import SensorInstance, refit
from volery.runtime.output_sink import OutputSink
from volery.runtime.services.uav_services import offer_uav_services
from volery.runtime.vehicles.battery_failsafe import BatteryFailsafe
from volery.runtime.vehicles.command_interface import open_commands
from volery.runtime.vehicles.external_odometry import ExternalOdometry
from volery.runtime.vehicles.flight_futures import CHECK_PERIOD_S, FlightFutures
from volery.runtime.vehicles.flight_states import FlightStates
from volery.runtime.vehicles.pose_transforms import PoseTransforms
from volery.runtime.vehicles.uav import Uav
from volery.runtime.vehicles.uav_sensors import UavSensors
from volery.runtime.vehicles.uav_table import UavTable
from volery.scenario.schema import Scenario
from volery.sensors.cameras.camera import EVERY_PART, Part
from volery.sensors.samples import SensorId
from volery.vehicle.airframe import Airframe
from volery.world.terrain import Terrain

_ROOT = "/"
"""Namespace of the nodes of the whole system."""

_log = logging.getLogger(__name__)


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
    partition: Partition = WHOLE
    """UAVs whose LIDARs, cameras and nodes exist here."""
    fitted: list[SensorInstance] = field(default_factory=list)
    uavs: UavTable = field(default_factory=UavTable)
    nodes: list[Node] = field(default_factory=list)
    """Nodes in fleet order, then those of the whole system."""
    beginnings: dict[str, InitialState] = field(default_factory=dict)
    flight_states: FlightStates = field(init=False)
    pose_aids: ExternalOdometry = field(init=False)
    transforms: PoseTransforms = field(init=False)
    futures: FlightFutures = field(init=False)
    """Futures of the UAVs' flight commands."""
    _battery_failsafe: BatteryFailsafe = field(init=False)
    _opened: dict[str, UndoSteps] = field(default_factory=dict)
    """What was made for each UAV."""

    def __post_init__(self) -> None:
        origin = self.scenario.world.origin
        self.pose_aids = ExternalOdometry(self.graph, self.engine)
        self.flight_states = FlightStates(self.graph, self.engine, origin)
        self.transforms = PoseTransforms(self.graph, self.engine)
        self.futures = FlightFutures(self._fleet_row_of, self.runs)
        self._battery_failsafe = BatteryFailsafe(self.engine, self.uavs.get)
        self.outlet.on_event = self._on_event

    def open(self, parts: Assembly) -> None:
        """Connects the engine's first UAVs to the graph."""
        self.flight_states.start(self.engine.every)
        self.pose_aids.start(self.engine.every)
        self.transforms.start(self.engine.every)
        futures = self.futures
        self.engine.every(CHECK_PERIOD_S, futures.check, wanted=lambda: futures.needs_checks)
        self._join(parts, self.starts, parts.fleet.get_state())
        self.start_nodes()

    def regroup(self, starts: Sequence[StartPose]) -> Callable[[], None]:
        """Replaces the UAVs by `starts`; call `start_nodes` for the nodes of new UAVs.

        If a step fails, the UAVs are those of before, and the error is raised. Returns a function
        that undoes the addition of UAVs, to be called before the next tick.
        """
        if not self.engine.stands:
            raise CommandError("UAVs are spawned and deleted between ticks; use post()")
        if not starts:
            raise CommandError("a simulation needs at least one UAV")
        parts = assemble(self.scenario, starts, self.engine.scene, self.partition)
        undo = UndoSteps()

        def undo_all() -> None:
            _report(undo.run(), "a part of a change of the UAVs was not undone")

        try:
            self._replace(parts, tuple(starts), undo)
        except Exception:
            undo_all()
            raise
        return undo_all

    def start_nodes(self) -> None:
        """Starts the nodes of UAVs without nodes, and those of the system if none runs."""
        served = {node.get_namespace() for node in self.nodes}
        own = [start for start in self.starts if self.partition.serves(start.name)]
        alone = [start for start in own if f"/{start.name}" not in served]
        now_ns = self._now_ns
        self.nodes += start_nodes(self.scenario, alone, self.graph, self.engine, now_ns)
        if _ROOT not in served and self.partition.is_leader:
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
        for node in self._nodes_of(name):
            node.destroy_node()
            self.nodes.remove(node)
        self.start_nodes()

    def end_nodes(self) -> None:
        """Destroys all nodes."""
        while self.nodes:
            self.nodes.pop().destroy_node()

    # -------------------------------------------------------------------------------- inside

    def _replace(self, parts: Assembly, starts: tuple[StartPose, ...], undo: UndoSteps) -> None:
        """Passes from the present UAVs to those of `starts`."""
        undo.add(partial(add_bodies, self.engine.scene, self.starts))
        going_on = {start.name for start in starts if start in self.starts}
        new = [start for start in starts if start not in self.starts]
        fresh = {start.name for start in new}
        ended = [start for start in self.starts if start.name not in going_on]
        names = tuple(start.name for start in starts)
        begun = parts.fleet.get_state()
        undo.add(self._restoring())
        undo.add(self.engine.regroup(parts.fleet, parts.banks, names, parts.estimation, going_on))
        self.outlet.fleet = parts.fleet
        self.starts = starts
        for start in ended:
            if start.name in fresh:  # its names must be free for the new one
                again = start, self.uavs[start.name], self.beginnings[start.name], self.fitted
                undo.add(partial(self._reopen, *again))
                self._dismiss(start.name)
        for start in new:
            undo.add(partial(self._dismiss, start.name))
        self._join(parts, new, begun)
        self.faults.enlist(fresh)
        self._restart_sensors(fresh)
        for start in ended:
            if start.name not in fresh:
                self._dismiss(start.name)

    def _restoring(self) -> Callable[[], None]:
        """Returns a function that restores what refers to the present fleet."""
        starts, fitted, fleet = self.starts, self.fitted, self.outlet.fleet
        fleet_rows = {name: uav.fleet_row for name, uav in self.uavs.items()}
        banks = self.engine.banks

        def restore() -> None:
            self.starts, self.fitted, self.outlet.fleet = starts, fitted, fleet
            for name, uav in self.uavs.items():
                uav.move_to(fleet_rows[name])
            self._sort_uavs()
            self.outlet.latest.arrange(banks, fitted)

        return restore

    def _reopen(
        self, start: StartPose, uav: Uav, beginning: InitialState, fitted: list[SensorInstance]
    ) -> None:
        """Restores a UAV that was dismissed, without its nodes."""
        self._announce(start.name, fitted)
        self._enlist(start, uav, beginning)

    def _join(self, parts: Assembly, new: Sequence[StartPose], begun: dict[str, Any]) -> None:
        """Connects new UAVs to the graph, and all UAVs to the parts of a fleet."""
        self.fitted = parts.fitted
        for start in new:
            self._announce(start.name, self.fitted)
        self.publisher.arrange([start.name for start in self.starts])
        self.outlet.latest.arrange(parts.banks, self.fitted)
        for bank in parts.banks:
            if bank.name == "camera":
                cameras: Any = bank
                cameras.bank.requested_parts = partial(self._requested_parts, bank.sensors)
                self.publisher.cameras.set_size(bank.sensors, cameras.bank.pixels)
        for row, start in enumerate(self.starts):
            if start in new:
                uav = self._new_uav(start, parts.fleet, row)
                self._enlist(start, uav, InitialState(begun, row))
            else:
                self.uavs[start.name].move_to((parts.fleet, row))
        self._sort_uavs()

    def _sort_uavs(self) -> None:
        """Sorts the UAVs in fleet order."""
        names = [start.name for start in self.starts if start.name in self.uavs]
        self.uavs.update({name: self.uavs.pop(name) for name in names})

    def _announce(self, name: str, fitted: Iterable[SensorInstance]) -> None:
        """Advertises the topics of a UAV's sensors."""
        opened = self._opened.setdefault(name, UndoSteps())
        if errors := opened.run():  # what did not end when an earlier UAV of the name was removed
            raise errors[0]
        opened.add(partial(self.outlet.latest.forget, name))
        opened.add(partial(self.publisher.retire, name))
        own = [f for f in fitted if f.id.uav_name == name]
        announce_sensors(self.publisher, own, self.partition)

    def _new_uav(self, start: StartPose, fleet: Fleet, row: int) -> Uav:
        return Uav(
            fleet,
            row,
            start.name,
            self.scenario.types[start.type_name].flight,
            start.type_name,
            self._check_goal,
            sensors=UavSensors(self.outlet.latest, self.runs, start.name),
            futures=self.futures,
        )

    def _enlist(self, start: StartPose, uav: Uav, beginning: InitialState) -> None:
        """Adds a UAV and opens its commands."""
        opened = self._opened[start.name]
        self.uavs[start.name] = uav
        self.beginnings[start.name] = beginning
        opened.add(partial(self._forget, start.name))
        opened.add(partial(self.futures.fail, start.name, "the UAV was deleted"))
        opened.add_each(open_commands(self.graph, uav, self._now_ns))
        opened.add_each(offer_uav_services(self.graph, uav))
        opened.add_each(self.flight_states.open(uav))
        uav_type = self.scenario.types[start.type_name]
        opened.add_each(self.pose_aids.open(start.name, uav_type.sensors))
        opened.add_each(self.transforms.open(start.name, uav_type))
        if self.radio is not None and uav_type.radio:
            opened.add(self.radio.join(start.name))

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

    def _dismiss(self, name: str) -> None:
        """Removes a UAV, as far as it was made; what fails is tried again before a new one."""
        opened = self._opened.setdefault(name, UndoSteps())
        for node in reversed(self._nodes_of(name)):
            self.nodes.remove(node)
            opened.add(partial(_destroy, node))
        _report(opened.run(), f"a part of {name} was not removed")

    def _forget(self, name: str) -> None:
        self.uavs.pop(name).move_to(None)
        del self.beginnings[name]

    def _nodes_of(self, name: str) -> list[Node]:
        return [node for node in self.nodes if node.get_namespace() == f"/{name}"]

    def _restart_sensors(self, fresh: set[str]) -> None:
        keys = {(f.id.uav, f.id.name): f.key for f in self.fitted if f.id.uav_name in fresh}
        rows = [row for row, start in enumerate(self.starts) if start.name in fresh]
        self.engine.restart_sensors(np.array(rows, np.int64), NamedStreams(keys))

    def _now_ns(self) -> int:
        return self.engine.time_ns


def _destroy(node: Node) -> None:
    node.destroy_node()


def _report(errors: Iterable[Exception], what: str) -> None:
    for error in errors:
        _log.warning("%s: %s", what, error, exc_info=error)
