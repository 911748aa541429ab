"""Creates all services of a simulation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from volery.runtime.services.actors import offer_actors
from volery.runtime.services.air_and_faults import offer_air_and_faults
from volery.runtime.services.control_authority import offer_piloting
from volery.runtime.services.entities import Entities
from volery.runtime.services.features import offer_features
from volery.runtime.services.grid_maps import offer_grid_maps
from volery.runtime.services.named_poses import offer_named_poses
from volery.runtime.services.recording import RecordingServices
from volery.runtime.services.simulation_state import SimulationStateServices
from volery.runtime.services.single_steps import offer_steps
from volery.runtime.services.snapshot_services import SnapshotServices
from volery.runtime.services.spawning import SpawnServices
from volery.runtime.services.worlds import OnLoad, offer_worlds
from volery.scenario.catalog import ScenarioCatalog

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation


class ServiceSet:
    """Holds the state of one simulation's services."""

    def __init__(self, playing: SimulationStateServices, recording: RecordingServices) -> None:
        self._playing = playing
        self._recording = recording

    @property
    def state(self) -> int:
        """State of the simulation, as the standard numbers it."""
        return int(self._playing.state)

    @property
    def recording(self) -> str:
        """Path of the log that a client records, below the folder of recordings; empty: none."""
        return self._recording.name

    def close(self) -> None:
        """Ends a recording that is still running."""
        self._recording.close()


def open_services(
    simulation: Simulation,
    *,
    recordings: Path | None = None,
    on_load: OnLoad | None = None,
    shelf: ScenarioCatalog | None = None,
    every: Callable[..., None],
) -> ServiceSet:
    """Creates the standard's services and Volery's own; see `Simulation` for the arguments.

    `every(period_s, callback, wanted=...)` schedules a callback in simulated time.
    """
    graph = simulation.graph
    offer_features(graph, loads_worlds=on_load is not None)
    Entities(simulation).offer()
    SpawnServices(simulation).offer()
    playing = SimulationStateServices(simulation)
    playing.offer()
    offer_steps(simulation)
    offer_worlds(graph, simulation.scenario, on_load, shelf)
    offer_named_poses(graph, simulation.starts)
    offer_air_and_faults(simulation)
    if simulation.actors is not None:
        offer_actors(simulation, simulation.actors, every)
    if simulation.scenario.world.grid_map is not None:
        settings = simulation.scenario.world.grid_map
        offer_grid_maps(graph, simulation.grid_world, settings, lambda: simulation.time_ns)
    offer_piloting(graph, simulation.operators)
    SnapshotServices(simulation).offer()
    recording = RecordingServices(graph, recordings, simulation.commands)
    recording.offer()
    return ServiceSet(playing, recording)
