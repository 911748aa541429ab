"""Builds the engine of a simulation, and the graph that it publishes on."""

from __future__ import annotations

from typing import NamedTuple

from volery.engine.command_queue import CommandQueue
from volery.engine.engine import Engine
from volery.engine.pacing import Pacer
from volery.graph.graph import Graph
from volery.publishing.graph_publisher import GraphPublisher
from volery.runtime.construction.assembly import Assembly, assemble
from volery.runtime.construction.fleet import place_fleet
from volery.runtime.construction.partition import WHOLE, Partition
from volery.runtime.construction.placement import StartPose
from volery.runtime.construction.worlds import BuiltWorld
from volery.runtime.output_sink import OutputSink
from volery.scenario.schema import Scenario


class ConnectedEngine(NamedTuple):
    """An engine with the scenario's UAVs at their start, and the graph that it publishes on."""

    engine: Engine
    graph: Graph
    publisher: GraphPublisher
    outlet: OutputSink
    starts: tuple[StartPose, ...]
    assembly: Assembly


def build_engine(
    scenario: Scenario, world: BuiltWorld, pacer: Pacer, partition: Partition = WHOLE
) -> ConnectedEngine:
    """Returns an engine whose runs `pacer` paces. Raises `ScenarioError`, `DataFileError`."""
    starts = place_fleet(scenario, world.scene, world.terrain)
    assembly = assemble(scenario, starts, world.scene, partition)
    commands = CommandQueue(on_post=pacer.wake)
    graph = Graph(lambda: engine.time_ns, commands.post)
    publisher = GraphPublisher(graph)
    outlet = OutputSink(assembly.fleet, graph, publisher)
    engine = Engine(
        assembly.fleet,
        world.scene,
        world.terrain,
        assembly.banks,
        tuple(start.name for start in starts),
        outlet,
        crash_on_contact=scenario.physics.on_contact == "crash",
        estimation=assembly.estimation,
        inbox=commands,
    )
    return ConnectedEngine(engine, graph, publisher, outlet, starts, assembly)
