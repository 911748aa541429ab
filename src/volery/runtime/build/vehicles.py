"""Builds the manager of a simulation's vehicles, with their radio network and faults."""

from __future__ import annotations

from volery.engine.faults import FaultPlan
from volery.runtime.build.engine import ConnectedEngine
from volery.runtime.build.radio import build_radio
from volery.runtime.build.worlds import BuiltWorld
from volery.runtime.conditional_runs import ConditionalRuns
from volery.runtime.vehicles.manager import VehicleManager
from volery.scenario.schema import Scenario


def build_vehicles(
    scenario: Scenario, connected: ConnectedEngine, world: BuiltWorld, runs: ConditionalRuns
) -> VehicleManager:
    """Returns the manager of the engine's vehicles, which are not on the graph yet."""
    engine, graph = connected.engine, connected.graph
    radio = build_radio(scenario, graph, engine, world.forest)
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
    )
