"""Builds the manager of a simulation's vehicles, with their radio network and faults."""

from __future__ import annotations

from collections.abc import Mapping

from volery.comms.radio.channel import RadioChannel
from volery.comms.radio.network import RadioNetwork
from volery.core.arrays import Array
from volery.engine.engine import Engine
from volery.engine.faults import FaultPlan
from volery.graph.graph import Graph
from volery.runtime.conditional_runs import ConditionalRuns
from volery.runtime.construction.engine import ConnectedEngine
from volery.runtime.construction.line_of_sight import LineOfSight
from volery.runtime.construction.partition import WHOLE, Partition
from volery.runtime.construction.worlds import BuiltWorld
from volery.runtime.vehicles.manager import VehicleManager
from volery.scenario.schema import Scenario
from volery.world.forest import Forest


def build_vehicles(
    scenario: Scenario,
    connected: ConnectedEngine,
    world: BuiltWorld,
    runs: ConditionalRuns,
    partition: Partition = WHOLE,
) -> VehicleManager:
    """Returns the manager of the engine's vehicles, which are not on the graph yet."""
    engine, graph = connected.engine, connected.graph
    radio = _build_radio(scenario, graph, engine, world.forest)
    return VehicleManager(
        scenario,
        engine,
        graph,
        connected.publisher,
        connected.outlet,
        FaultPlan(engine, radio),
        connected.starts,
        world.terrain,
        runs,
        radio,
        partition,
    )


def _build_radio(
    scenario: Scenario, graph: Graph, engine: Engine, forest: Forest | None
) -> RadioNetwork | None:
    """Returns the network that the scenario's UAVs join; None without a radio."""
    radio = scenario.radio
    if radio is None:
        return None

    def positions() -> Mapping[int, Array]:
        position = engine.fleet.state.position_map
        rows = {name: row for row, name in enumerate(engine.names)}
        return {address: position[rows[name]] for name, address in net.addresses().items()}

    link = None
    if radio.links == "modelled":
        link = RadioChannel(radio, scenario.seed, positions, LineOfSight(engine.scene, forest))
    net = RadioNetwork(graph, engine, radio.topics, link)
    return net
