"""A running simulation, made from a scenario."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from volery.control.setpoints import checked, checked_attitude
from volery.core.clock import s_from_ns
from volery.core.errors import CommandError, ScenarioError
from volery.engine.engine import Engine
from volery.engine.events import Event
from volery.engine.faults import FaultPlan
from volery.engine.lock_step import Partner, check_terms
from volery.engine.pacing import Pacer
from volery.engine.single_steps import OnSteps, StepRequest
from volery.graph.graph import Graph
from volery.graph.nodes.failures import reported_failures
from volery.graph.nodes.node import Node
from volery.graph.nodes.presence import outside_nodes
from volery.graph.session import Gateway, Post
from volery.publishing.graph_publisher import GraphPublisher
from volery.runtime.build.assembly import assemble
from volery.runtime.build.fleet import place
from volery.runtime.build.geometry import Geometry, WorldTopic
from volery.runtime.build.graph import all_down, plan_faults
from volery.runtime.build.message_loading import learn_messages
from volery.runtime.build.placement import StartPose
from volery.runtime.build.radio import build_radio
from volery.runtime.build.sensor_suites import lidar_mounts
from volery.runtime.build.worlds import build_world
from volery.runtime.checks import check_reset_seed, check_seconds, check_steps
from volery.runtime.end_of_run import EndOfRun
from volery.runtime.grid_map_manager import GridMapManager
from volery.runtime.monitoring import Monitor
from volery.runtime.monitoring.output_sink import OutputSink
from volery.runtime.monitoring.progress import Progress
from volery.runtime.monitoring.status import StatusSources
from volery.runtime.replay.command_log import CommandLog
from volery.runtime.replay.command_replay import CommandReplay
from volery.runtime.replay.scenario_record import tell_origin
from volery.runtime.run_loop import RunLoop
from volery.runtime.services import ServiceSet, open_services
from volery.runtime.services.lock_step import open_lock_step
from volery.runtime.services.weather_messages import WeatherTopics
from volery.runtime.services.worlds import OnLoad
from volery.runtime.snapshot import Snapshot
from volery.runtime.snapshot_manager import SnapshotManager
from volery.runtime.vehicles.control_authority import ControlAuthority
from volery.runtime.vehicles.manager import VehicleManager
from volery.runtime.vehicles.rotor_layouts import rotor_layouts
from volery.runtime.vehicles.spawning import Spawner
from volery.runtime.vehicles.teleport import Teleporter
from volery.runtime.vehicles.uav import Uav
from volery.runtime.warmup.parallel_compilation import compiled
from volery.runtime.warmup.requirements import needs_of
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.faults import Fault, parse_fault
from volery.scenario.schema import Scenario, UavType
from volery.sensors.mount import Mount
from volery.world.actors import MovingActors
from volery.world.ground_cover import BARE_GROUND
from volery.world.weather import Weather

if TYPE_CHECKING:
    from volery.bridges.logs.recorded_flight import RecordedFlight
    from volery.bridges.logs.replay import Replay

_CLOCK_PERIOD_S = 0.01
_DIGEST_PERIOD_S = 0.01
_FARTHEST_M, _FASTEST_M_S = 1e5, 100.0
"""Limits of poses and velocities of actors."""


class Simulation:
    """World, fleet, sensors, graph and nodes of a scenario, on one clock.

    `threads` share the ray casting; results do not depend on their number. `recordings` is the
    folder in which clients of the graph may record, None: nowhere. `on_load` is called, in the
    simulation's thread, with the scenario that a client wants instead of this one, or with None
    where it wants none; without `on_load` both are refused. `shelf` has the scenarios that clients
    can name, None: those that ship. Use it as a context manager, or call `close` at the end. Raises
    `ScenarioError` where the scenario cannot be built.
    """

    uavs: Mapping[str, Uav]
    """In fleet order."""
    operators: ControlAuthority
    """Who steers which UAV."""
    commands: CommandLog
    """What clients do, told on `/volery/log`."""
    gateway: Gateway
    """Where clients of other threads join the graph."""
    outlet: OutputSink
    """Where steps, measurements and events go."""
    grid_world: GridMapManager
    """The grid map whose blocks stand in the world, and how it is changed."""
    end: EndOfRun
    """What clients meet where the scenario has ended."""
    _geometry: Geometry | None = None
    """The last answer of `geometry`."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        threads: int = 2,
        recordings: Path | None = None,
        on_load: OnLoad | None = None,
        shelf: ScenarioCatalog | None = None,
    ) -> None:
        if threads < 1:
            raise ScenarioError(f"threads must be at least 1 (found {threads})")
        self.scenario = scenario
        self._build_world(threads)
        self._closed = False
        self._pacer = Pacer()

        starts = place(scenario, self.scene, self.terrain)
        parts = assemble(scenario, starts, self.scene)
        self.graph = Graph(lambda: self.time_ns, self.post)
        self.gateway = Gateway(
            self.graph,
            self.post,
            open_queue=self._open_queue,
            is_busy=self._is_busy,
            is_late=lambda: self._pacer.speed is not None and self._is_busy(),
            rotor_layouts=lambda: rotor_layouts(self.uavs),
        )
        publisher = GraphPublisher(self.graph)
        self.outlet = OutputSink(parts.fleet, self.graph, publisher)
        self._engine = Engine(
            parts.fleet,
            self.scene,
            self.terrain,
            parts.banks,
            tuple(start.name for start in starts),
            self.outlet,
            crash_on_contact=scenario.physics.on_contact == "crash",
            estimation=parts.estimation,
            on_post=self._pacer.wake,
        )
        self.commands = CommandLog(self.graph, self._engine)
        self.gateway.watch = self.commands.watch
        self._repetition: CommandReplay | None = None
        tell_origin(self.graph, scenario)
        self.grid_world = GridMapManager(scenario, self._engine)
        self._world_topic = WorldTopic(self.graph, lambda: self.geometry)
        self.grid_world.on_blocks = lambda: self.post(self._world_topic.tell)
        self.radio = build_radio(scenario, self.graph, self._engine, self.forest)
        """What the UAVs speak to each other by; None: the scenario has none."""
        self._faults = FaultPlan(self._engine, self.radio)
        self._crew = VehicleManager(
            scenario,
            self._engine,
            self.graph,
            publisher,
            self.outlet,
            self._faults,
            starts,
            self.terrain,
            self.radio,
        )
        self.uavs = MappingProxyType(self._crew.uavs)
        self.operators = ControlAuthority(lambda: self.uav_names)
        self._partners: list[Partner] = []
        self._replays: list[Replay] = []
        self._keep_time(publisher)
        self._live = Monitor(
            self,
            self._engine,
            StatusSources(
                lambda: self._services.state,
                lambda: self._services.recording,
                lambda: self.end.waits,
            ),
        )
        self._weather_topics = WeatherTopics(
            self.graph, scenario.world, lambda: self.weather, self.set_weather
        )
        self._weather_topics.tell(self.weather)
        self._crew.open(parts)
        plan_faults(self._faults, scenario)
        self._loop = RunLoop(self._engine, self._pacer, scenario.duration_s, self._has_ended)
        self._loop.look = self._live.look
        self.end = EndOfRun(self._engine, self._pacer, self._loop, self.commands)
        self._relocator = Teleporter(self._engine, self.scene, self.terrain, self._crew)
        open_lock_step(self)
        self._services: ServiceSet = open_services(
            self, recordings=recordings, on_load=on_load, shelf=shelf, every=self._engine.every
        )
        self._keeper = SnapshotManager(
            self._engine,
            self.graph,
            self._faults,
            publisher,
            self._loop,
            self._crew,
            self._partners,
            self.outlet,
            self.grid_world,
            self.radio,
        )
        self._spawner = Spawner(self._crew, self._keeper, self.scene, self.terrain)
        self._crew.take_off(self.uavs)
        self._world_topic.tell()

    # -------------------------------------------------------------------------------------- time

    @property
    def time_ns(self) -> int:
        """Simulated time."""
        return self._engine.time_ns

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return s_from_ns(self.time_ns)

    @property
    def finished(self) -> bool:
        """Whether the end has come: the scenario's duration, all UAVs down again, or `quit`."""
        return self._loop.finished

    def step(self, steps: int = 1) -> None:
        """Advance by physics steps (1 ms each unless the scenario says otherwise)."""
        self._check_open()
        check_steps(steps)
        with reported_failures(self.graph):
            self._engine.advance_to(self._engine.fleet.step + steps)

    def run(
        self,
        seconds: float | None = None,
        *,
        speed: float | None = None,
        on_progress: Callable[[Progress], None] | None = None,
    ) -> None:
        """Advance by `seconds`, or to the scenario's end.

        `speed` is a factor of real time, None runs as fast as possible; `pause`, `single_step` and
        `set_speed` change that from another thread or from `on_progress`, which is called about ten
        times a second of wall time, also while paused. Parts of a physics step are owed to the next
        call, so that many short runs come as far as a long one.
        """
        self._check_open()
        if seconds is not None:
            check_seconds(seconds)
        with reported_failures(self.graph):
            self._loop.run(seconds, speed, on_progress)

    def wait_at_end(self, on_wait: Callable[[], None]) -> None:
        """Stay paused at the end for clients, until they reset, continue or quit; see `end`.

        `on_wait` is called about fifty times a second and may raise.
        """

        def process() -> None:
            on_wait()
            self.process_commands()

        self.end.wait(process)

    # From here to `post`, everything may be called by any thread, while the simulation runs or not.

    @property
    def paused(self) -> bool:
        """Whether a run is held, or would be held where it starts."""
        return self._pacer.paused

    @property
    def paused_s(self) -> float:
        """Wall seconds that runs have been paused in all."""
        return self._pacer.paused_s

    @property
    def speed(self) -> float | None:
        """Factor of real time of the present or last run, None for as fast as possible."""
        return self._pacer.speed

    def pause(self) -> None:
        """Hold the run between two ticks, and later ones at their start, until `resume`.

        `post`ed actions are still done; results do not depend on pauses.
        """
        self._pacer.pause()

    def resume(self) -> None:
        """Go on after a pause, without catching up what was missed."""
        self._pacer.resume()

    def quit(self) -> None:
        """End the present run as soon as may be, and later ones at their start."""
        self._loop.quit()

    @property
    def quitting(self) -> bool:
        """Whether somebody called `quit`."""
        return self._loop.quitting

    def set_speed(self, speed: float | None) -> None:
        """Change the present run's factor of real time; None goes as fast as possible."""
        self._pacer.set_speed(speed)

    def single_step(self, steps: int = 1, on_steps: OnSteps | None = None) -> StepRequest:
        """Let a paused run advance by physics steps and wait again; `CommandError` if not paused.

        Returns at once: the thread that runs makes the steps, and tells `on_steps` of them. Where
        none does, use `step`.
        """
        return self._pacer.single_steps(steps, on_steps)

    def cancel_steps(self, request: StepRequest) -> None:
        """Make no more steps of a `single_step`."""
        self._pacer.drop_steps("cancelled", request)

    def use_low_latency(self) -> None:
        """Keep real time to the physics step from now on, for clients who wait for answers.

        Costs a few tenths of a core; at full speed and for results it changes nothing.
        """
        self._pacer.use_low_latency()

    @property
    def weather(self) -> Weather:
        """The air: what blows, falls and hangs in it, and the hour."""
        return self._engine.fleet.weather

    def set_weather(self, weather: Weather) -> None:
        """Let `weather` blow from the next guidance tick on and be seen in the next measurement."""
        self._engine.set_weather(weather)
        self._weather_topics.tell(weather)

    def gust_now(
        self, amplitude_map: tuple[float, float, float], rise_s: float, lasts_s: float = math.inf
    ) -> None:
        """Let a 1-cosine gust of `amplitude_map` (3,) m/s begin now, over after `lasts_s`."""
        self._check_open()
        self._engine.gust_now(amplitude_map, rise_s, lasts_s)
        self._weather_topics.tell(self.weather)

    def post(self, action: Callable[[], Any]) -> Future[Any]:
        """Have `action()` called by the simulation's thread before its next tick, or while paused.

        The only way for other threads to touch what is simulated; the future holds the action's
        result or error, a `CommandError` where the simulation is closed first.
        """
        return self._engine.inbox.post(action)

    def replay_log(self, replay: Replay) -> None:
        """Let a recorded log speak into the graph, beginning now, in simulated time."""
        self._check_open()
        replay.start(self.graph, self._engine, lambda: self.time_ns)
        self._replays.append(replay)

    @property
    def replaying(self) -> bool:
        """Whether a recorded log is speaking into the graph."""
        return any(replay.info.running for replay in self._replays)

    def replay_commands(self, flight: RecordedFlight) -> None:
        """Take the commands of a recorded flight again, each at its moment; see `repetition`.

        `run` ends where that flight did. `CommandError` where the simulation has begun.
        """
        self._check_open()
        if self._engine.moment > (0, 0):
            raise CommandError("a flight is repeated from its start; make a new simulation")
        self._repetition = self._engine.repeats = CommandReplay(
            flight, self.gateway, self._engine, self._pacer, self.commands
        )
        self.commands.repeats = self._loop.replays = True

    def process_commands(self) -> None:
        """Do what other threads have posted, and hand out what that published, without a step.

        For the thread that owns the simulation; `run` and `step` do it by themselves.
        """
        self._check_open()
        self._engine.process_commands(math.inf)
        self._live.look()

    def inject_fault(self, fault: Fault | Mapping[str, Any]) -> None:
        """Injects a fault as in a scenario's `faults`, at once if its time is past.

        `simulation.inject_fault({"kind": "motor", "uav": "uav1", "rotor": 0})`. Raises
        `CommandError` for an impossible one.
        """
        self._check_open()
        self._faults.add(parse_fault(fault), client=self.graph.acting_client)

    def end_fault(self, fault: Fault | Mapping[str, Any]) -> None:
        """Ends a fault that has begun; it is described as in `inject`, its times do not count.

        `simulation.end_fault({"kind": "motor", "uav": "uav1", "rotor": 0})`. Nothing changes
        without such a fault. Raises `CommandError` for one that cannot be, and for a gust or a
        displacement.
        """
        self._check_open()
        self._faults.end(parse_fault(fault), client=self.graph.acting_client)

    def add_partner(
        self,
        name: str,
        *,
        period_s: float,
        timeout_s: float = 10.0,
        on_timeout: Literal["stop", "leave"] = "stop",
        on_meeting: Callable[[int], None] | None = None,
        is_there: Callable[[], bool] | None = None,
        supports_reset: bool = False,
        meets_at_start: bool = False,
    ) -> Partner:
        """Wait for an outside program each `period_s` of simulated time; see `engine.lock_step`.

        `timeout_s` is wall time; a partner that lets more pass ends the run with `PartnerError`, or
        is waited for no more. `on_meeting(time_ns)` is called when a meeting begins; a partner that
        is not there any more, as `is_there()` says, is waited for no more. `restarts`: it begins
        anew where a meeting's time is earlier than the last one's, so that `reset` is possible.
        `meets_at_start`: before the first step it is met at time 0 too, not only after a period.
        """
        self._check_open()
        check_terms(period_s, timeout_s, on_timeout, self._engine.fleet.dt_ns)
        if any(partner.name == name and not partner.has_left for partner in self._partners):
            raise CommandError(f"there is a lock-step partner '{name}' already")
        partner = Partner(
            name,
            timeout_s,
            on_timeout,
            on_meeting=on_meeting,
            is_there=is_there,
            supports_reset=supports_reset,
            meets_at_start=meets_at_start,
            period_s=period_s,
        )
        self._partners.append(partner)
        self._engine.wait_for(partner, period_s)
        return partner

    def close(self) -> None:
        """Give threads and scene memory back; nothing can be simulated afterwards."""
        if not self._closed:
            self._closed = True
            self._pacer.drop_steps("the simulation is closed")
            self._services.close()
            for partner in self._partners:
                partner.leave()
            self._crew.end_nodes()
            self._engine.inbox.close("the simulation is closed")
            self.scene.close()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    # ------------------------------------------------------------------------------------ snapshots

    def snapshot(self) -> Snapshot:
        """The present state, for `restore`.

        Raises `SnapshotError` where a node or a lock-step partner does not offer its state, and in
        the middle of a tick: nodes and timers ask for one through `post`.
        """
        self._check_open()
        return self._keeper.snapshot()

    def restore(self, snapshot: Snapshot) -> None:
        """Go back, or forward, to a state of this simulation: what follows is the same again."""
        self._check_open()
        self._keeper.restore(snapshot)
        self._pacer.drop_steps("another state was restored")
        self._pacer.jumped(self.time_ns)
        self._live.jumped()
        self.end.left()

    def reset(self, seed: int | None = None) -> None:
        """Go back to the start, with the scenario's seed or another one.

        All that follows is what a fresh simulation of `scenario.with_(seed=seed)` does. A grid map
        is the one of the start again; UAVs that were spawned go, deleted ones come back. Nodes are
        as new: where one does not offer its state, all are made anew. Raises `CommandError` for
        another seed where the scenario's seed grew trees or city, which a reset keeps; `world.seed`
        fixes them apart from all other randomness.
        """
        self._check_open()
        if seed is not None:
            check_reset_seed(self.scenario, seed)
        self._keeper.reset(self.scenario.seed if seed is None else seed)
        self._pacer.drop_steps("the simulation was reset")
        self._pacer.jumped(self.time_ns)
        self._live.jumped()
        self.end.left()

    def reset_uav(self, name: str) -> None:
        """Put one UAV back to its start while the others fly on: as it was, mended, charged, new.

        Its plant, controllers, sensors, estimate and nodes begin anew, with the noise of the start;
        guidance and sensors keep their phase. `CommandError` where its place is taken.
        """
        self._check_open()
        self._keeper.reset_uav(self._row_of(name))

    # -------------------------------------------------------------------------------- changing it

    def set_uav_pose(self, name: str, position_map: ArrayLike, attitude: ArrayLike) -> None:
        """Put a UAV at (3,) m with (4,) x y z w, map from body; its motion goes on there.

        If it flies it holds there; if it stood it hovers where that is in the air. `PlacementError`
        with the reason where it cannot be there.
        """
        self._check_open()
        self._relocator.place(self._row_of(name), position_map, attitude)

    def set_uav_velocity(self, name: str, velocity_map: ArrayLike, omega_map: ArrayLike) -> None:
        """Let a UAV move at (3,) m/s and turn at (3,) rad/s, map, from which its controllers go on.

        If it flies it brakes, and holds. `CommandError` for what is out of range.
        """
        self._check_open()
        self._relocator.move(self._row_of(name), velocity_map, omega_map)

    @property
    def actors(self) -> MovingActors | None:
        """People, vehicles and birds of the scenario; None where it has none."""
        return self.scene.actors

    def set_actor_pose(
        self,
        name: str,
        position_map: ArrayLike,
        attitude: ArrayLike | None = None,
        velocity_map: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Moves an external actor to (3,) m with (4,) x y z w, map from body, from now on.

        It goes on from there at `velocity_map` (3,) m/s; without an attitude it keeps its own.
        `CommandError` for one that does not exist, that goes its own way, or for such a place.
        """
        self._check_open()
        if self.actors is None or name not in self.actors.names:
            known = "none" if self.actors is None else ", ".join(self.actors.names)
            raise CommandError(f"there is no actor '{name}'; known: {known}")
        row = self.actors.names.index(name)
        if attitude is None:
            attitude = self.actors.poses_at(self.time_ns)[row, 3:]
        position = checked("position", position_map, (3,), _FARTHEST_M)
        velocity = checked("velocity", velocity_map, (3,), _FASTEST_M_S)
        pose = np.concatenate([position, checked_attitude(attitude)])
        self._engine.set_actor_pose(row, pose, velocity)

    def spawn_uav(
        self,
        name: str,
        kind: str,
        position_map: ArrayLike,
        attitude: ArrayLike = (0.0, 0.0, 0.0, 1.0),
    ) -> Uav:
        """Put a new UAV at (3,) m with (4,) x y z w, map from body, while the others go on.

        `kind` is one of `spawnable`. It stands or, in the air, holds; its topics, services, sensors
        and nodes begin now. A place between its feet and the ground is taken to be on the ground.
        Raises `SpawnError` for a name or type that cannot be, `PlacementError` for such a place.
        """
        self._check_open()
        return self._spawner.spawn(name, kind, position_map, attitude)

    def delete_uav(self, name: str) -> None:
        """Take a UAV out, with all that is its own, while the others go on; one must stay."""
        self._check_open()
        self._row_of(name)
        self._spawner.delete([name])

    def delete_spawned(self) -> None:
        """Take all UAVs out that were not there at the start."""
        self._check_open()
        self._spawner.delete(self.spawned)

    @property
    def spawned(self) -> tuple[str, ...]:
        """Names of the UAVs that were not there at the start."""
        return tuple(self._keeper.spawned)

    @property
    def spawnable(self) -> tuple[str, ...]:
        """What can be spawned: the scenario's types and, with the usual sensors, every airframe."""
        return self._spawner.kinds

    @property
    def types(self) -> Mapping[str, UavType]:
        """The scenario's types and those of UAVs that were spawned."""
        return self._crew.scenario.types

    # -------------------------------------------------------------------------------- what is known

    @property
    def picture_rates(self) -> dict[str, float]:
        """About how many bytes a second each topic of a camera takes in a log."""
        return self._crew.publisher.cameras.log_rates()

    @property
    def starts(self) -> tuple[StartPose, ...]:
        """Where the UAVs began, in fleet order."""
        return self._crew.starts

    @property
    def nodes(self) -> tuple[Node, ...]:
        """The nodes that run inside, in fleet order, then those of the whole system."""
        return tuple(self._crew.nodes)

    @property
    def mounts(self) -> Mapping[str, Mount]:
        """Topics of LaserScans and how their LIDARs are mounted."""
        return lidar_mounts(self._crew.fitted, planar=True)

    @property
    def cloud_mounts(self) -> Mapping[str, Mount]:
        """Topics of PointCloud2s and how their LIDARs are mounted."""
        return lidar_mounts(self._crew.fitted, planar=False)

    @property
    def geometry(self) -> Geometry:
        """What stands in the world at present; any thread may ask."""
        present, solids = self._geometry, self.scene.solids
        if present is None or present.solids is not solids:
            cover = BARE_GROUND if self.city is None else self.city.cover
            present = self._geometry = Geometry(self.terrain, self.forest, solids, cover)
        return present

    @property
    def client_names(self) -> frozenset[str]:
        """Full names of external nodes, of lock-step partners and of clients of bridges."""
        partners = (partner.name for partner in self._partners if not partner.has_left)
        sessions = (info.name for info in self.gateway.sessions() if " " in info.name)
        return frozenset((*outside_nodes(self.graph), *partners, *sessions))

    @property
    def uav_names(self) -> tuple[str, ...]:
        """Names in fleet order."""
        return tuple(self.uavs)

    @property
    def events(self) -> tuple[Event, ...]:
        """Everything that happened so far, oldest first."""
        return tuple(self.outlet.events)

    @property
    def stage_seconds(self) -> dict[str, float]:
        """Wall seconds spent in each stage of the step so far."""
        return dict(self._engine.stage_seconds)

    @property
    def stage_cpu_s(self) -> dict[str, float]:
        """CPU seconds of this thread in each stage so far."""
        return dict(self._engine.stage_cpu_s)

    def enable_digest(self) -> None:
        """Fingerprint all states and messages from now on; call before the first step."""
        self.outlet.enable_digest()

    def digest(self, *, by_topic: bool = False) -> str:
        """SHA-256 over all states and sensor messages since `enable_digest`, in their order.

        `by_topic`: whatever the order between topics, as for a comparison with nodes outside.
        """
        digest = self.outlet.digest
        if digest is None:
            raise CommandError("call enable_digest() before the run")
        return digest.hexdigest_by_topic() if by_topic else digest.hexdigest()

    # ----------------------------------------------------------------------------------- building

    def _build_world(self, threads: int) -> None:
        """Build the world; a first start compiles what the flight calls."""
        scenario = self.scenario
        learn_messages(scenario)  # which the modules of nodes may ask for
        with compiled(needs_of(scenario)):
            self.terrain, self.city, self.forest, self.scene = build_world(scenario, threads)

    def _keep_time(self, publisher: GraphPublisher) -> None:
        """Publish the clock, and take fingerprints, while somebody wants them."""
        outlet, every = self.outlet, self._engine.every
        every(
            _CLOCK_PERIOD_S,
            lambda: publisher.publish_clock(self.time_ns),
            wanted=lambda: publisher.clock_wanted,
        )
        every(_DIGEST_PERIOD_S, outlet.take_fingerprint, wanted=lambda: outlet.digest is not None)

    def _open_queue(self) -> Post:
        """Where the commands of one external client are posted, at its own expense."""
        return self._engine.inbox.open_queue().post

    def _is_busy(self) -> bool:
        """Whether there is no time to spare for what clients send; partners are waited for."""
        return self._pacer.is_behind and not self._partners

    def _check_open(self) -> None:
        if self._closed:
            raise CommandError("the simulation is closed; make a new one")

    def _row_of(self, name: str) -> int:
        if name not in self.uavs:
            raise CommandError(f"there is no UAV '{name}'; known: {', '.join(self.uavs)}")
        return self.uav_names.index(name)

    def _has_ended(self) -> bool:
        """Whether every UAV has flown and is down for good, where the scenario ends with that.

        Or whether a flight that is repeated ended here.
        """
        if self._repetition is not None and self._repetition.over:
            return True
        return self.scenario.ends_when == "all_landed" and all_down(self.uavs, self.outlet.events)
