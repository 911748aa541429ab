"""A running simulation, made from a scenario."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from volery.control.flight_modes import FlightMode
from volery.core.clock import ns_from_s, s_from_ns
from volery.core.errors import CommandError, ScenarioError, SnapshotError
from volery.engine.engine import Engine
from volery.engine.events import Event
from volery.engine.faults import FaultPlan
from volery.engine.pacing import Pacer
from volery.engine.partners import Partner, check_terms
from volery.graph.graph import Graph
from volery.graph.node import Context, Node
from volery.graph.publishing import GraphPublisher
from volery.graph.session import Gateway
from volery.runtime.building import add_bodies, build_fleet, check_free, place
from volery.runtime.checks import check_seconds, check_seed, check_steps
from volery.runtime.command_door import open_commands
from volery.runtime.digest import Digest
from volery.runtime.estimation_building import build_estimation
from volery.runtime.node_loading import start_node
from volery.runtime.placement import Start
from volery.runtime.progress import Progress, ProgressTeller
from volery.runtime.sensor_building import build_banks
from volery.runtime.sensor_fitting import RESULT_OF, Fitted, fit_sensors, lidar_mounts, refit
from volery.runtime.snapshot import (
    Snapshot,
    check_nodes,
    check_partners,
    keep_nodes,
    put_back_nodes,
)
from volery.runtime.uav import Uav
from volery.runtime.warm_up import compile_kernels
from volery.runtime.worlds import build_forest, build_terrain
from volery.scenario.faults import Fault, parse_fault
from volery.scenario.schema import Scenario
from volery.sensors.samples import JointAngles, Samples
from volery.world.scene import Scene
from volery.world.weather import Weather

_CLOCK_PERIOD_S = 0.01
_DIGEST_PERIOD_S = 0.01


class Simulation:
    """World, fleet, sensors, graph and nodes of a scenario, on one clock.

    `threads` share the ray casting; results do not depend on their number. Use it as a context
    manager, or call `close` at the end. Raises `ScenarioError` where the scenario cannot be built.
    """

    def __init__(self, scenario: Scenario, *, threads: int = 2) -> None:
        if threads < 1:
            raise ScenarioError(f"threads must be at least 1 (found {threads})")
        compile_kernels()
        self.scenario = scenario
        self.terrain = build_terrain(scenario)
        self.forest = build_forest(scenario, self.terrain)
        self.scene = Scene(self.terrain, self.forest, threads=threads)
        self._closed = False
        self._owed_ns = 0
        self._pacer = Pacer()
        self._digest: Digest | None = None
        self._events: list[Event] = []

        starts = place(scenario, self.scene, self.terrain)
        names = tuple(start.name for start in starts)
        self._fleet = build_fleet(scenario, starts, names)
        add_bodies(self.scene, starts)
        fitted = self._fitted = fit_sensors(scenario, starts)
        self.graph = Graph(lambda: self.time_ns, self.post)
        self.gateway = Gateway(self.graph, self.post)
        """Where clients of other threads join the graph."""
        self._publisher = _make_publisher(self.graph, fitted)
        self.mounts = lidar_mounts(fitted, planar=True)
        self.cloud_mounts = lidar_mounts(fitted, planar=False)
        estimation = build_estimation(scenario, fitted, self._fleet)
        self._banks = build_banks(scenario, fitted, self._fleet, self.scene, estimation)
        self._engine = Engine(
            self._fleet,
            self.scene,
            self.terrain,
            self._banks,
            names,
            self,
            crash_on_contact=scenario.physics.on_contact == "crash",
            estimation=estimation,
        )
        self.uavs: Mapping[str, Uav] = MappingProxyType(
            {
                s.name: Uav(self._fleet, row, s.name, scenario.types[s.type_name].flight)
                for row, s in enumerate(starts)
            }
        )
        self.nodes: list[Node] = []
        self._partners: list[Partner] = []
        self._open_graph(starts)
        self._faults = FaultPlan(self._engine, names)
        self._plan_faults()
        self._starts = starts
        self._start_state = self._state()
        self._take_off(names)

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
        """Whether the scenario's end has come: its duration, or all UAVs down again."""
        if self.time_s >= self.scenario.duration_s:
            return True
        return self._has_ended()

    def step(self, steps: int = 1) -> None:
        """Advance by physics steps (1 ms each unless the scenario says otherwise)."""
        self._check_open()
        check_steps(steps)
        self._engine.advance_to(self._fleet.step + steps)

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
        left = self.scenario.duration_s - self.time_s if seconds is None else seconds
        start_s = self.time_s
        end_step = self._fleet.step + self._whole_steps(left, seconds is None)
        until = self._has_ended if seconds is None else None
        pacer = self._pacer
        pacer.begin(speed, self.time_ns)
        teller = ProgressTeller(on_progress, left, pacer)
        over = self._fleet.step >= end_step
        while not over:
            steps = pacer.next_steps(self._fleet.dt_ns)
            if steps:
                self._engine.advance_to(min(end_step, self._fleet.step + steps), until=until)
            over = self._fleet.step >= end_step or (until is not None and until())
            while pacer.wait(self.time_ns) and not (over and pacer.paused):
                self._engine.take_in()
                teller.tell(self.time_s - start_s)
            teller.tell(self.time_s - start_s, last=over)

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

    def set_speed(self, speed: float | None) -> None:
        """Change the present run's factor of real time; None goes as fast as possible."""
        self._pacer.set_speed(speed)

    def single_step(self, steps: int = 1) -> None:
        """Let a paused run advance by physics steps and wait again; `CommandError` if not paused.

        Returns at once: the thread that runs makes the steps. Where none does, use `step`.
        """
        self._pacer.single_steps(steps)

    def be_prompt(self) -> None:
        """Keep real time to the physics step from now on, for clients who wait for answers.

        Costs a few tenths of a core; at full speed and for results it changes nothing.
        """
        self._pacer.be_prompt()

    @property
    def weather(self) -> Weather:
        """The air."""
        return self._fleet.weather

    def set_weather(self, weather: Weather) -> None:
        """Let `weather` blow from the next guidance tick on."""
        self._engine.set_weather(weather)

    def gust_now(
        self, amplitude_map: tuple[float, float, float], rise_s: float, lasts_s: float = math.inf
    ) -> None:
        """Let a 1-cosine gust of `amplitude_map` (3,) m/s begin now, over after `lasts_s`."""
        self._check_open()
        self._engine.gust_now(amplitude_map, rise_s, lasts_s)

    def post(self, action: Callable[[], Any]) -> Future[Any]:
        """Have `action()` called by the simulation's thread before its next tick, or while paused.

        The only way for other threads to touch what is simulated; the future holds the action's
        result or error.
        """
        future = self._engine.inbox.post(action)
        self._pacer.wake()
        return future

    def inject(self, fault: Fault | Mapping[str, Any]) -> None:
        """Let something go wrong: a fault as in a scenario's `faults`, at once if its time is past.

        `simulation.inject({"kind": "motor", "uav": "uav1", "rotor": 0})`. Raises `CommandError` for
        one that cannot be.
        """
        self._check_open()
        self._faults.add(parse_fault(fault))

    def add_partner(
        self,
        name: str,
        *,
        period_s: float,
        timeout_s: float = 10.0,
        on_timeout: Literal["stop", "leave"] = "stop",
    ) -> Partner:
        """Wait for an outside program each `period_s` of simulated time; see `engine.partners`.

        `timeout_s` is wall time; a partner that lets more pass ends the run with `PartnerError`, or
        is waited for no more.
        """
        self._check_open()
        check_terms(period_s, timeout_s, on_timeout, self._fleet.dt_ns)
        if any(partner.name == name and not partner.has_left for partner in self._partners):
            raise CommandError(f"there is a lock-step partner '{name}' already")
        partner = Partner(name, timeout_s, on_timeout)
        self._partners.append(partner)
        self._engine.wait_for(partner, period_s)
        return partner

    def close(self) -> None:
        """Give threads and scene memory back; nothing can be simulated afterwards."""
        if not self._closed:
            self._closed = True
            for partner in self._partners:
                partner.leave()
            for node in self.nodes:
                node.destroy_node()
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
        self._check_standing("a snapshot")
        return Snapshot(self.time_ns, id(self), self._state())

    def restore(self, snapshot: Snapshot) -> None:
        """Go back, or forward, to a state of this simulation: what follows is the same again."""
        self._check_standing("to restore a state")
        if not isinstance(snapshot, Snapshot):
            raise SnapshotError(f"not a snapshot: {snapshot!r}")
        if snapshot.owner != id(self):
            raise SnapshotError("the snapshot is of another simulation")
        self._put_back(snapshot.state)

    def reset(self, seed: int | None = None) -> None:
        """Go back to the start, with the scenario's seed or another one.

        All that follows is what a fresh simulation does, but for the world: terrain and trees stay
        as they are (a scenario's `world.seed` fixes them apart from all other randomness).
        """
        self._check_standing("a reset")
        if seed is not None:
            check_seed(seed)
        self._put_back(self._start_state)
        self._seed_streams(self.scenario.seed if seed is None else seed)
        self._take_off(self.uav_names)

    def reset_uav(self, name: str) -> None:
        """Put one UAV back to its start while the others fly on: as it was, mended, charged, new.

        Its plant, controllers, sensors, estimate and nodes begin anew, with the noise of the start;
        guidance and sensors keep their phase. `CommandError` where its place is taken.
        """
        if name not in self.uavs:
            raise CommandError(f"there is no UAV '{name}'; known: {', '.join(self.uavs)}")
        row = self.uav_names.index(name)
        nodes = [k for k, node in enumerate(self.nodes) if node.get_namespace() == f"/{name}"]
        self._check_standing("a reset", [self.nodes[k] for k in nodes])
        start = self._start_state["engine"]["fleet"]
        check_free(self._fleet, row, start["position"][0, row])
        rows = np.array([row])
        self._fleet.restart(start, rows)
        self._engine.collisions.forget(rows)
        keys = {(f.id.uav, f.id.name): f.key for f in self._fitted if f.id.uav == row}
        self._engine.restart_sensors(rows, keys)
        states = self._start_state["nodes"]
        put_back_nodes([self.nodes[k] for k in nodes], [states[k] for k in nodes])
        self._faults.mend(row)
        self._take_off([name])

    def _seed_streams(self, seed: int) -> None:
        """Give sensors and turbulence the random streams of another run; at the start only."""
        rows = np.arange(len(self._fleet))
        self._fleet.seed_turbulence(seed, rows, self.uav_names)
        fitted = refit(self._fitted, seed)
        self._engine.restart_sensors(rows, {(f.id.uav, f.id.name): f.key for f in fitted})

    def _state(self) -> dict[str, Any]:
        return {
            "engine": self._engine.get_state(),
            "graph": self.graph.get_state(),
            "faults": self._faults.get_state(),
            "publisher": self._publisher.get_state(),
            "nodes": keep_nodes(self.nodes),
            "digest": None if self._digest is None else self._digest.get_state(),
            "events": list(self._events),
            "owed_ns": self._owed_ns,
        }

    def _put_back(self, state: dict[str, Any]) -> None:
        put_back_nodes(self.nodes, state["nodes"])
        self._engine.set_state(state["engine"])
        self.graph.set_state(state["graph"])
        self._faults.set_state(state["faults"])
        self._publisher.set_state(state["publisher"])
        if self._digest is not None:
            self._digest.set_state(state["digest"])
        self._events[:] = state["events"]
        self._owed_ns = state["owed_ns"]

    def _check_standing(self, what: str, nodes: Sequence[Node] | None = None) -> None:
        self._check_open()
        check_nodes(self.nodes if nodes is None else nodes, what)
        check_partners(self._partners, what)
        if not self._engine.stands:
            raise SnapshotError(f"{what} is not possible in the middle of a tick; use post()")

    # -------------------------------------------------------------------------------- what is known

    @property
    def uav_names(self) -> tuple[str, ...]:
        """Names in fleet order."""
        return tuple(self.uavs)

    @property
    def events(self) -> tuple[Event, ...]:
        """Everything that happened so far, oldest first."""
        return tuple(self._events)

    @property
    def stage_seconds(self) -> dict[str, float]:
        """Wall seconds spent in each stage of the step so far."""
        return dict(self._engine.stage_seconds)

    def enable_digest(self) -> None:
        """Fingerprint all states and messages from now on; call before the first step."""
        if self._digest is None:
            self._digest = Digest()
            self.graph.subscribe_all(self._digest.add_message)

    def digest(self) -> str:
        """SHA-256 over all states and sensor messages since `enable_digest`."""
        if self._digest is None:
            raise CommandError("call enable_digest() before the run")
        return self._digest.hexdigest()

    # ------------------------------------------------------------------------ the engine's sink

    def advanced(self, first_step: int, last_step: int) -> None:
        """Take in computed steps (called by the engine)."""
        if self._digest is not None:
            self._digest.add_steps(self._fleet.history, first_step, last_step)

    def sampled(self, samples: Samples) -> None:
        """Publish measurements (called by the engine)."""
        self._publisher.publish(samples)

    def happened(self, event: Event) -> None:
        """Keep and publish an event (called by the engine)."""
        self._events.append(event)
        self._publisher.publish_event(event)

    def deliver(self) -> None:
        """Hand out queued messages (called by the engine)."""
        self.graph.deliver()

    # ----------------------------------------------------------------------------------- building

    def _open_graph(self, starts: tuple[Start, ...]) -> None:
        publisher, every = self._publisher, self._engine.every
        every(
            _CLOCK_PERIOD_S,
            lambda: publisher.publish_clock(self.time_ns),
            wanted=lambda: publisher.clock_wanted,
        )
        every(_DIGEST_PERIOD_S, self._take_fingerprint, wanted=lambda: self._digest is not None)
        for uav in self.uavs.values():
            open_commands(self.graph, uav)
        for start in starts:
            for k, entry in enumerate(self.scenario.types[start.type_name].nodes):
                where = f"{self.scenario.name}: types.{start.type_name}.nodes[{k}]"
                latency_ns = ns_from_s(entry.latency_s)
                context = Context(self.graph, self._engine, lambda: self.time_ns, latency_ns)
                self.nodes.append(
                    start_node(entry, context, f"/{start.name}", where, self.scenario.folder)
                )

    def _take_off(self, names: Sequence[str]) -> None:
        """Let those of the UAVs take off that do so by themselves."""
        for start in self._starts:
            if start.takes_off and start.name in names:
                self.uavs[start.name].take_off()

    def _plan_faults(self) -> None:
        for k, fault in enumerate(self.scenario.faults):
            try:
                self._faults.add(fault)
            except CommandError as error:
                raise ScenarioError(f"{self.scenario.name}: faults[{k}]: {error}") from None

    def _take_fingerprint(self) -> None:
        if self._digest is not None:
            self._digest.add_states(self._fleet)

    def _check_open(self) -> None:
        if self._closed:
            raise CommandError("the simulation is closed; make a new one")

    def _whole_steps(self, seconds: float, to_the_end: bool) -> int:
        if to_the_end:
            return math.ceil(ns_from_s(max(seconds, 0.0)) / self._fleet.dt_ns)
        steps, self._owed_ns = divmod(self._owed_ns + ns_from_s(seconds), self._fleet.dt_ns)
        return steps

    def _has_ended(self) -> bool:
        """Whether every UAV has flown and is down for good, where the scenario ends with that."""
        if self.scenario.ends_when != "all_landed":
            return False
        modes = [uav.mode for uav in self.uavs.values()]
        flown = {e.uav for e in self._events}
        return all(
            mode is FlightMode.CRASHED or (mode is FlightMode.LANDED and name in flown)
            for name, mode in zip(self.uavs, modes, strict=True)
        )


def _make_publisher(graph: Graph, fitted: list[Fitted]) -> GraphPublisher:
    publisher = GraphPublisher(graph)
    for sensor in fitted:
        if sensor.lidar is not None:
            publisher.announce_lidar(sensor.id, sensor.lidar, sensor.topic, sensor.mount)
        else:
            publisher.announce(sensor.id, RESULT_OF[sensor.spec.kind], sensor.mount)
        if sensor.mount.nods:
            publisher.announce(sensor.id, JointAngles, sensor.mount)
    return publisher
