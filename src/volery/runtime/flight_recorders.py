"""The flight recorders of a simulation, and what they read of it."""

from __future__ import annotations

from volery.engine.events import Event
from volery.results.drawn_world import DrawnWorld
from volery.results.flight_result import FlightResult
from volery.runtime.facets.world import SimulationWorld
from volery.runtime.flight_recorder import FlightRecorder
from volery.runtime.vehicles.manager import VehicleManager


class FlightRecorders:
    """Starts recorders, and resumes them after jumps in time."""

    def __init__(self, manager: VehicleManager, world: SimulationWorld) -> None:
        self._run = _Run(manager, world)
        self._engine = manager.engine
        self._active: list[FlightRecorder] = []

    def start(self, rate_hz: float) -> FlightRecorder:
        """Starts a recorder. Raises `CommandError` for an impossible rate."""
        recorder = FlightRecorder(self._engine, self._run, rate_hz, self._active.remove)
        self._active.append(recorder)
        return recorder

    def jumped(self) -> None:
        """Resumes all recorders after a reset or a restored state."""
        for recorder in self._active:
            recorder.resume()

    def present(self) -> FlightResult:
        """Returns the flight of the first active recorder; without one, the present state alone."""
        if self._active:
            return self._active[0].result()
        with FlightRecorder(self._engine, self._run, 1.0, lambda _: None) as recorder:
            return recorder.result()


class _Run:
    """Describes the run of a simulation; see `RecordedRun`."""

    def __init__(self, manager: VehicleManager, world: SimulationWorld) -> None:
        self.name = manager.scenario.name
        self._manager = manager
        self._world = world
        self._drawn: DrawnWorld | None = None
        self._solids: object = None

    @property
    def seed(self) -> int:
        """Seed of the scenario, or of the last reset."""
        return self._manager.scenario.seed

    @property
    def events(self) -> list[Event]:
        """All events so far, oldest first."""
        return self._manager.outlet.events

    @property
    def world(self) -> DrawnWorld:
        """World as drawn on maps; the same object until its solids change."""
        scene = self._world.scene
        if self._drawn is None or self._solids is not scene.solids:
            self._solids = scene.solids
            meshes = tuple(solid.mesh for solid in scene.solids)
            self._drawn = DrawnWorld(self._world.terrain, self._world.forest, meshes)
        return self._drawn
