"""A running simulation, made from a scenario."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volery.core.clock import s_from_ns
from volery.core.errors import CommandError, ScenarioError
from volery.core.plurals import counted
from volery.core.uncopied import Uncopied
from volery.engine.engine import Division
from volery.engine.events import Event
from volery.engine.lock_step import Partner
from volery.engine.pacing import Pacer
from volery.graph.graph import Graph
from volery.graph.nodes.failures import reported_failures
from volery.graph.session import Gateway
from volery.runtime.checks import check_reset_seed, check_seconds, check_steps
from volery.runtime.conditional_runs import (
    CHECK_PERIOD_S,
    DEFAULT_TIMEOUT_S,
    Awaited,
    ConditionalRuns,
)
from volery.runtime.construction.engine import build_engine
from volery.runtime.construction.gateway import build_gateway
from volery.runtime.construction.geometry import Geometry, WorldTopic
from volery.runtime.construction.graph import all_down, plan_faults
from volery.runtime.construction.partition import WHOLE, Partition
from volery.runtime.construction.start_check import check_start
from volery.runtime.construction.vehicles import build_vehicles
from volery.runtime.construction.worlds import build_world
from volery.runtime.division_parts import DivisionParts
from volery.runtime.end_of_run import EndOfRun
from volery.runtime.facets.clock import SimulationClock
from volery.runtime.facets.diagnostics import SimulationDiagnostics
from volery.runtime.facets.faults import SimulationFaults
from volery.runtime.facets.vehicles import SimulationVehicles
from volery.runtime.facets.world import SimulationWorld
from volery.runtime.flight_recorder import DEFAULT_RATE_HZ, FlightRecorder
from volery.runtime.flight_recorders import FlightRecorders
from volery.runtime.grid_map_manager import GridMapManager
from volery.runtime.monitoring.monitor import Monitor
from volery.runtime.monitoring.progress import Progress
from volery.runtime.monitoring.progress_bar import progress_bar
from volery.runtime.monitoring.status import StatusSources
from volery.runtime.replay.command_log import CommandLog
from volery.runtime.replay.command_repeater import CommandRepeater
from volery.runtime.replay.command_replay import CommandReplay
from volery.runtime.replay.scenario_record import publish_origin
from volery.runtime.run_loop import RunLoop
from volery.runtime.services.recording import RecordingServices
from volery.runtime.services.service_set import open_services
from volery.runtime.services.simulation_state import SimulationStateServices
from volery.runtime.services.worlds import OnLoad
from volery.runtime.snapshot import Snapshot
from volery.runtime.snapshot_manager import SnapshotManager
from volery.runtime.vehicles.control_authority import ControlAuthority
from volery.runtime.vehicles.uav import Uav
from volery.runtime.vehicles.uav_table import UavView
from volery.runtime.warmup.parallel_compilation import compiled
from volery.runtime.warmup.requirements import needs_of
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.schema import Scenario
from volery.world.ground_cover import BARE_GROUND

if TYPE_CHECKING:
    from volery.bridges.logs.recorded_flight import RecordedFlight
    from volery.bridges.logs.replay import Replay
    from volery.results import FlightResult


class Simulation(Uncopied):
    """World, fleet, sensors, graph and nodes of a scenario, on one clock.

    `threads` share the ray casting; results do not depend on their number. `recordings` is the
    folder in which clients of the graph may record; None: nowhere. `on_load` is called, in the
    simulation's thread, with the scenario that a client requests instead of this one, or with None
    for no world; without `on_load` both are refused. `shelf` holds the scenarios that clients can
    name; None: the shipped ones. Use it as a context manager, or call `close` at the end. Raises
    `ScenarioError` for a scenario that cannot be built.
    """

    scenario: Scenario
    """Scenario that is simulated."""
    graph: Graph
    """Topics and services."""
    gateway: Gateway
    """Joins clients of other threads to the graph."""
    uavs: Mapping[str, Uav]
    """Handles of the UAVs by name, in fleet order."""
    operators: ControlAuthority
    """Operators in control of UAVs."""
    commands: CommandLog
    """Commands of clients, published on `/volery/log`."""
    clock: SimulationClock
    """Pauses, single steps, real-time factor, lock-step partners."""
    vehicles: SimulationVehicles
    """Spawns, deletes, moves, resets and describes UAVs."""
    world: SimulationWorld
    """Terrain, trees, city, grid map, actors, weather."""
    faults: SimulationFaults
    """Injects and ends faults."""
    diagnostics: SimulationDiagnostics
    """Events, digests, computing time, clients."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        threads: int = 2,
        recordings: Path | None = None,
        on_load: OnLoad | None = None,
        shelf: ScenarioCatalog | None = None,
        partition: Partition = WHOLE,
    ) -> None:
        if threads < 1:
            raise ScenarioError(f"threads must be at least 1 (found {threads})")
        self.scenario = scenario
        self._closed = False
        self._partners: list[Partner] = []
        self._replays: list[Replay] = []
        self._command_replay: CommandReplay | None = None
        self._geometry: Geometry | None = None
        check_start(scenario)
        with compiled(needs_of(scenario)):
            world = build_world(scenario, threads)
        self._pacer = pacer = Pacer()
        connected = build_engine(scenario, world, pacer, partition)
        self._engine = engine = connected.engine
        self.graph = graph = connected.graph
        self._loop = RunLoop(engine, pacer, scenario.duration_s, self._has_ended)
        self._end = EndOfRun(engine, pacer, self._loop)
        self._runs = ConditionalRuns(
            engine, self._loop, connected.outlet.events, self._look, self._check_open
        )
        self.commands = CommandLog(graph, engine, self._end.refusal)
        publish_origin(graph, scenario)
        world_topic = WorldTopic(graph, lambda: self.geometry)
        grid_map = GridMapManager(scenario, engine, lambda: self.post(world_topic.publish))
        self._manager = manager = build_vehicles(scenario, connected, world, self._runs, partition)
        self._snapshots = SnapshotManager(manager, self._loop, self._partners, grid_map)
        self.uavs = UavView(manager.uavs)
        self.operators = ControlAuthority(lambda: tuple(self.uavs), self.graph.moved_uavs.of)
        self.gateway = build_gateway(graph, engine, pacer, self.commands, self.uavs, self._partners)
        self.clock = SimulationClock(engine, pacer, self._loop, self._partners, self._check_open)
        self.vehicles = SimulationVehicles(manager, self._snapshots, self._check_open)
        self.faults = SimulationFaults(manager.faults, graph, self._check_open)
        self.diagnostics = SimulationDiagnostics(manager, self.gateway, self._partners)
        self._recording = RecordingServices(graph, recordings, self.commands)
        self._run_state = SimulationStateServices(
            graph, self.clock, self.vehicles, self._end, self.reset
        )
        self._monitor = Monitor(manager, self.gateway, self.operators, self._status_sources())
        self.world = SimulationWorld(
            scenario.world, world, grid_map, engine, graph, self._check_open
        )
        self._recorders = FlightRecorders(manager, self.world)
        manager.open(connected.assembly)
        plan_faults(manager.faults, scenario)
        open_services(
            self,
            self._run_state,
            self._recording,
            self._end,
            on_load=on_load,
            catalog=shelf,
            every=engine.every,
        )
        self._snapshots.save_start()
        manager.take_off(self.uavs)
        world_topic.publish()

    # ---------------------------------------------------------------------------------------- runs

    @property
    def time_ns(self) -> int:
        """Simulated time."""
        return self._engine.time_ns

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return s_from_ns(self.time_ns)

    def step(self, steps: int = 1) -> None:
        """Advances by physics steps (1 ms each unless the scenario says otherwise)."""
        self._check_open()
        check_steps(steps)
        with reported_failures(self.graph), self._loop.occupied():
            self._engine.advance_to(self._engine.fleet.step + steps)

    def run(
        self,
        seconds: float | None = None,
        *,
        speed: float | None = None,
        on_progress: Callable[[Progress], None] | None = None,
        progress: bool = False,
    ) -> None:
        """Advances by `seconds`, or to the scenario's end.

        `speed` is the real-time factor; None runs as fast as possible. `clock` changes it from
        another thread or from `on_progress`, which is called about ten times a second of wall time,
        also while paused. `progress` shows a bar of tqdm, on a terminal or in a notebook. The next
        call makes up for parts of a physics step, so that many short runs come as far as a long
        one.
        """
        self._check_open()
        if seconds is not None:
            check_seconds(seconds)
        if progress:
            with progress_bar(self.scenario.name, on_progress) as update:
                self.run(seconds, speed=speed, on_progress=update)
            return
        with reported_failures(self.graph):
            self._loop.run(seconds, speed, on_progress, self._monitor.look)

    def run_until(
        self,
        awaited: Awaited,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        *,
        speed: float | None = None,
        check_period_s: float = CHECK_PERIOD_S,
    ) -> Event | None:
        """Advances until something has happened; returns the event, if `awaited` is one.

        awaited: a function without arguments that returns whether to stop, which is called at each
        multiple of `check_period_s` since time 0; a `FlightFuture` (`uav.take_off()`), or several:
        until all are done; an `EventKind` or its name ("collision"): until the next such event.
        `timeout_s` is simulated time, s, `math.inf` for no limit; the scenario's end does not end
        the wait. `speed` is as for `run`. Raises `FlightError` if a flight command fails,
        `WaitTimeoutError` after `timeout_s`, `CommandError` within a run or a tick.
        """
        with reported_failures(self.graph):
            return self._runs.run_until(awaited, timeout_s, speed, check_period_s)

    async def run_async(self, seconds: float | None = None, *, speed: float | None = None) -> None:
        """Advances like `run`, by `seconds`, s, while other coroutines run in between.

        For notebooks and other asyncio programs: `task = asyncio.create_task(
        simulation.run_async(speed=1.0))`, then `await uav.go_to(...)`. Cancel the task to stop.
        """
        self._check_open()
        if seconds is not None:
            check_seconds(seconds)
        with reported_failures(self.graph):
            await self._runs.drive(self._loop.pieces(seconds, speed, None, self._look))

    async def run_until_async(
        self,
        awaited: Awaited,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        *,
        speed: float | None = None,
        check_period_s: float = CHECK_PERIOD_S,
    ) -> Event | None:
        """Advances like `run_until`, while other coroutines run in between.

        The arguments are the same; `timeout_s` and `check_period_s` are simulated time, s.
        """
        with reported_failures(self.graph):
            return await self._runs.run_until_async(awaited, timeout_s, speed, check_period_s)

    def wait_at_end(self, on_wait: Callable[[], None]) -> None:
        """Stays paused at the end until clients reset the run, continue it or quit.

        `on_wait` is called about fifty times a second and may raise.
        """

        def process() -> None:
            on_wait()
            self.process_commands()

        self._end.wait(process)

    @property
    def waits_at_end(self) -> bool:
        """Whether it stays paused at the end of the scenario."""
        return self._end.waits

    @property
    def geometry(self) -> Geometry:
        """The present geometry of ground, trees and solids; any thread may read it."""
        present, world = self._geometry, self.world
        if present is None or present.solids is not world.scene.solids:
            cover = BARE_GROUND if world.city is None else world.city.cover
            present = self._geometry = Geometry(
                world.terrain, world.forest, world.scene.solids, cover
            )
        return present

    def post(self, action: Callable[[], Any]) -> Future[Any]:
        """Runs `action()` in the simulation's thread before its next tick, or while paused.

        The only way for other threads to change what is simulated. The future holds the action's
        result or error; `CommandError` if the simulation is closed first.
        """
        return self._engine.inbox.post(action)

    def process_commands(self) -> None:
        """Runs posted actions and delivers their messages, without a step.

        For the thread that owns the simulation; `run` and `step` do it by themselves.
        """
        self._check_open()
        self._engine.process_commands(math.inf)
        self._monitor.look()

    def divide(self, connect: Callable[[DivisionParts], Division]) -> None:
        """Keeps this machine in lock step with others that share its run; call it before a step.

        connect: returns the connection to the other machines.
        """
        engine, graph, manager = self._engine, self.graph, self._manager
        repeater = CommandRepeater(graph, engine, self._pacer, self.commands)
        engine.division = connect(
            DivisionParts(
                engine,
                graph,
                self.commands,
                repeater,
                lambda bank: manager.publisher.causes_actions(bank.sensors),
                lambda: tuple(manager.nodes),
            )
        )

    def follow(self) -> None:
        """Advances a worker's part of a divided run until its `Division` raises an error."""
        self._check_open()
        with reported_failures(self.graph), self._loop.occupied():
            self._engine.advance_to(sys.maxsize)

    # ------------------------------------------------------------------------------------- results

    def record(self, rate_hz: float = DEFAULT_RATE_HZ) -> FlightRecorder:
        """Records the true states of all UAVs from now on; `result()` returns them as arrays.

        rate_hz: samples per simulated second (Hz), at most one for each physics step. Recording
        changes no results. Raises `CommandError` for an impossible rate.
        """
        self._check_open()
        return self._recorders.start(rate_hz)

    def fly(
        self,
        seconds: float | None = None,
        *,
        rate_hz: float = DEFAULT_RATE_HZ,
        speed: float | None = None,
        on_progress: Callable[[Progress], None] | None = None,
        progress: bool = False,
    ) -> FlightResult:
        """Advances as `run` does and returns the flight: trajectories as arrays, and events.

        seconds, speed, on_progress and progress: those of `run`. rate_hz: samples per simulated
        second (Hz). Raises `CommandError` for an impossible rate.
        """
        with self.record(rate_hz) as recorder:
            self.run(seconds, speed=speed, on_progress=on_progress, progress=progress)
        return recorder.result()

    def __repr__(self) -> str:
        closed = ", closed" if self._closed else ""
        return (
            f"<Simulation '{self.scenario.name}': {self.time_s:.3f} of "
            f"{self.scenario.duration_s:g} s, {counted(len(self.uavs), 'UAV')}, "
            f"seed {self._manager.scenario.seed}{closed}>"
        )

    def _repr_html_(self) -> str:
        """Returns time, UAVs and a map with the recorded paths, for notebooks."""
        from volery.runtime.notebook_view import simulation_html

        flight = self._recorders.present()
        return simulation_html(self.scenario, self.time_s, self.uavs.values(), flight)

    # ---------------------------------------------------------------------------------------- logs

    def replay_log(self, replay: Replay | str | Path) -> None:
        """Publishes a recorded log, or the log at a path, into the graph in simulated time.

        The first message appears now. Raises `RecordingError` if there is no log at the path.
        """
        self._check_open()
        if isinstance(replay, (str, Path)):
            from volery.bridges.logs.replay import Replay

            replay = Replay(replay)
        replay.start(self.graph, self._engine, lambda: self.time_ns)
        self._replays.append(replay)

    def replay_commands(self, flight: RecordedFlight) -> None:
        """Replays the commands of a recorded flight, each at its time; see `command_replay`.

        `run` ends where that flight did. Raises `CommandError` if the simulation has begun.
        """
        self._check_open()
        if self._engine.moment > (0, 0):
            raise CommandError("a flight is repeated from its start; make a new simulation")
        self._command_replay = self._engine.repeats = CommandReplay(
            flight, self.gateway, self._engine, self._pacer, self.commands
        )
        self.commands.repeats = self._loop.replays = True

    # ------------------------------------------------------------------------------------ snapshots

    def snapshot(self) -> Snapshot:
        """Returns the present state, for `restore`.

        Raises `SnapshotError` where a node or a lock-step partner does not offer its state, and
        within a tick: nodes and timers take one through `post`.
        """
        self._check_open()
        return self._snapshots.snapshot()

    def restore(self, snapshot: Snapshot) -> None:
        """Restores a state of this simulation; what follows is the same again."""
        self._check_open()
        self._snapshots.restore(snapshot)
        self._has_jumped("another state was restored")

    def reset(self, seed: int | None = None) -> None:
        """Returns to the start, with the scenario's seed or another one.

        What follows equals a new simulation of `scenario.with_(seed=seed)`. The grid map is the
        one of the start; spawned UAVs are removed, deleted ones return. If a node does not offer
        its state, all nodes are made again. Raises `CommandError` for another seed where the
        scenario's seed grew trees or city, which a reset keeps; `world.seed` fixes them apart from
        all other randomness.
        """
        self._check_open()
        if seed is not None:
            check_reset_seed(self.scenario, seed)
        self._snapshots.reset(self.scenario.seed if seed is None else seed)
        self._has_jumped("the simulation was reset")

    def close(self) -> None:
        """Releases threads and scene memory; nothing can be simulated afterwards."""
        if not self._closed:
            self._closed = True
            self._pacer.drop_steps("the simulation is closed")
            self._recording.close()
            for partner in self._partners:
                partner.leave()
            self._manager.end_nodes()
            self._manager.futures.close()
            self._engine.inbox.close("the simulation is closed")
            self.world.scene.close()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    # -------------------------------------------------------------------------------------- inside

    def _look(self) -> None:
        self._monitor.look()

    def _status_sources(self) -> StatusSources:
        return StatusSources(
            speed=lambda: self._pacer.speed,
            state=lambda: int(self._run_state.state),
            recording=lambda: self._recording.name,
            replaying=lambda: any(replay.info.running for replay in self._replays),
            ended=lambda: self._end.waits,
        )

    def _check_open(self) -> None:
        if self._closed:
            raise CommandError("the simulation is closed; make a new one")

    def _has_jumped(self, reason: str) -> None:
        """Adjusts pacing and monitoring to another time."""
        self._pacer.drop_steps(reason)
        self._pacer.jumped(self.time_ns)
        self._monitor.jumped()
        self._recorders.jumped()
        self._end.left()

    def _has_ended(self) -> bool:
        """Whether all UAVs have landed, where the scenario ends with that, or a replay is over."""
        if self._command_replay is not None and self._command_replay.over:
            return True
        events = self._manager.outlet.events
        return self.scenario.ends_when == "all_landed" and all_down(self.uavs, events)
