"""Creates all services of a simulation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from volery.graph.graph import Graph
from volery.runtime.end_of_run import EndOfRun
from volery.runtime.facets.clock import SimulationClock
from volery.runtime.facets.faults import SimulationFaults
from volery.runtime.facets.vehicles import SimulationVehicles
from volery.runtime.facets.world import SimulationWorld
from volery.runtime.services.actors import offer_actors
from volery.runtime.services.air_and_faults import offer_air_and_faults
from volery.runtime.services.control_authority import offer_piloting
from volery.runtime.services.entities import Entities
from volery.runtime.services.features import offer_features
from volery.runtime.services.grid_maps import offer_grid_maps
from volery.runtime.services.lock_step import open_lock_step
from volery.runtime.services.named_poses import offer_named_poses
from volery.runtime.services.recording import RecordingServices
from volery.runtime.services.simulation_state import SimulationStateServices
from volery.runtime.services.single_steps import offer_steps
from volery.runtime.services.snapshot_services import SnapshotOwner, SnapshotServices
from volery.runtime.services.spawning import SpawnServices
from volery.runtime.services.worlds import OnLoad, offer_worlds
from volery.runtime.vehicles.control_authority import ControlAuthority
from volery.runtime.vehicles.uav import Uav
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.schema import Scenario


class ServedSimulation(SnapshotOwner, Protocol):
    """The members of a simulation that its services control."""

    scenario: Scenario
    graph: Graph
    uavs: Mapping[str, Uav]
    operators: ControlAuthority
    clock: SimulationClock
    vehicles: SimulationVehicles
    world: SimulationWorld
    faults: SimulationFaults


def open_services(
    simulation: ServedSimulation,
    run_state: SimulationStateServices,
    recording: RecordingServices,
    end: EndOfRun,
    *,
    on_load: OnLoad | None,
    catalog: ScenarioCatalog | None,
    every: Callable[..., None],
) -> None:
    """Creates the standard's services and Volery's own; see `Simulation` for the arguments.

    `every(period_s, callback, wanted=...)` schedules a callback in simulated time.
    """
    graph, scenario = simulation.graph, simulation.scenario
    clock, vehicles, world = simulation.clock, simulation.vehicles, simulation.world
    open_lock_step(graph, clock)
    offer_features(graph, loads_worlds=on_load is not None)
    Entities(graph, simulation.uavs, vehicles, world).offer()
    SpawnServices(graph, vehicles).offer()
    run_state.offer()
    offer_steps(graph, clock, end)
    offer_worlds(graph, scenario, on_load, catalog)
    offer_named_poses(graph, vehicles.start_poses)
    offer_air_and_faults(graph, scenario.world, world, simulation.faults)
    if world.actors is not None:
        offer_actors(graph, world, world.actors, every)
    if scenario.world.grid_map is not None:
        offer_grid_maps(graph, world.grid_map, scenario.world.grid_map, graph.now_ns)
    offer_piloting(graph, simulation.operators)
    SnapshotServices(graph, simulation, clock, vehicles).offer()
    recording.offer()
