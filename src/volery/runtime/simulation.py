"""A running simulation, made from a scenario."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.core.clock import ns_from_s, s_from_ns
from volery.core.errors import CommandError, DataFileError, ScenarioError
from volery.engine.engine import Engine
from volery.engine.events import Event
from volery.engine.pacing import Pacer
from volery.graph.graph import Graph
from volery.graph.node import Context, Node
from volery.graph.publishing import GraphPublisher
from volery.runtime.command_door import open_commands
from volery.runtime.digest import Digest
from volery.runtime.node_loading import start_node
from volery.runtime.placement import Start, place_uavs
from volery.runtime.sensor_building import Fitted, build_banks, fit_sensors, lidar_mounts
from volery.runtime.uav import Uav
from volery.runtime.warm_up import compile_kernels
from volery.runtime.worlds import build_forest, build_terrain
from volery.scenario.schema import Scenario
from volery.sensors.samples import (
    ImuReadings,
    JointAngles,
    OdometryReadings,
    RangeReadings,
    Samples,
)
from volery.vehicle.airframe import Airframe, load_airframe
from volery.vehicle.body_shape import body_shape
from volery.world.scene import Scene

_CLOCK_PERIOD_S = 0.01
_DIGEST_PERIOD_S = 0.01
_PROGRESS_PERIOD_S = 0.1
_RESULT_OF = {
    "imu": ImuReadings,
    "sonar": RangeReadings,
    "odometry": OdometryReadings,
    "ground_truth": OdometryReadings,
}


@dataclass(frozen=True)
class Progress:
    """How far a run has come."""

    time_s: float
    duration_s: float
    wall_s: float

    @property
    def real_time_factor(self) -> float:
        """Simulated over wall time of this run."""
        return self.time_s / self.wall_s if self.wall_s > 0.0 else 0.0


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
        self._digest: Digest | None = None
        self._events: list[Event] = []

        starts = self._place()
        self._fleet = _make_fleet(scenario, starts)
        _add_bodies(self.scene, starts)
        names = tuple(start.name for start in starts)
        fitted = fit_sensors(scenario, starts)
        self.graph = Graph(lambda: self.time_ns)
        self._publisher = _make_publisher(self.graph, fitted)
        self.mounts = lidar_mounts(fitted, planar=True)
        self.cloud_mounts = lidar_mounts(fitted, planar=False)
        self._banks = build_banks(scenario, fitted, self._fleet, self.scene)
        self._engine = Engine(
            self._fleet,
            self.scene,
            self.terrain,
            np.array(scenario.world.wind.velocity_m_s),
            self._banks,
            names,
            self,
            crash_on_contact=scenario.physics.on_contact == "crash",
        )
        self.uavs: Mapping[str, Uav] = MappingProxyType(
            {
                s.name: Uav(self._fleet, row, s.name, scenario.types[s.type_name].flight)
                for row, s in enumerate(starts)
            }
        )
        self.nodes: list[Node] = []
        self._open_graph(starts)

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
        if steps < 0:
            raise CommandError(f"steps must not be negative, not {steps}")
        self._engine.advance_to(self._fleet.step + steps)

    def run(
        self,
        seconds: float | None = None,
        *,
        speed: float | None = None,
        on_progress: Callable[[Progress], None] | None = None,
    ) -> None:
        """Advance by `seconds`, or to the scenario's end.

        `speed` is a factor of real time, None runs as fast as possible. `on_progress` is called
        about ten times a second of wall time. Parts of a physics step are owed to the next call, so
        that many short runs come as far as a long one.
        """
        self._check_open()
        if seconds is not None and not (math.isfinite(seconds) and seconds >= 0.0):
            raise CommandError(f"seconds must be finite and not negative, not {seconds}")
        left = self.scenario.duration_s - self.time_s if seconds is None else seconds
        start_s, start_ns = self.time_s, self.time_ns
        end_step = self._fleet.step + self._whole_steps(left, seconds is None)
        until = self._has_ended if seconds is None else None
        pacer = Pacer(speed, start_ns)
        slice_steps = _slice_steps(pacer.slice_ns(), self._fleet.dt_ns)
        wall_start = time.perf_counter()
        told = wall_start
        while self._fleet.step < end_step:
            self._engine.advance_to(min(end_step, self._fleet.step + slice_steps), until=until)
            ended = until is not None and until()
            last = ended or self._fleet.step >= end_step
            waiting = True
            while waiting:
                waiting = pacer.wait(self.time_ns)
                now = time.perf_counter()
                if on_progress is not None and (now - told >= _PROGRESS_PERIOD_S or last):
                    told = now
                    on_progress(Progress(self.time_s - start_s, left, now - wall_start))
            if ended:
                break

    def post(self, action: Callable[[], Any]) -> Future[Any]:
        """Have `action()` called by the simulation's thread before its next tick.

        The only call that other threads may make while the simulation runs; the future holds the
        action's result or error.
        """
        return self._engine.inbox.post(action)

    def close(self) -> None:
        """Give threads and scene memory back; nothing can be simulated afterwards."""
        if not self._closed:
            self._closed = True
            self.scene.close()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

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
            digest = self._digest = Digest()
            self.graph.subscribe_all(digest.add_message)
            self._engine.every(_DIGEST_PERIOD_S, lambda: digest.add_states(self._fleet))

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

    def _place(self) -> tuple[Start, ...]:
        airframes: dict[str, Airframe] = {}
        for name, kind in self.scenario.types.items():
            try:
                airframes[name] = load_airframe(kind.airframe, self.scenario.folder)
            except DataFileError as error:
                key = f"{self.scenario.name}: types.{name}.airframe"
                raise DataFileError(f"{key}: {error}") from None
        return place_uavs(self.scenario, airframes, self.scene, self.terrain)

    def _open_graph(self, starts: tuple[Start, ...]) -> None:
        self._engine.every(_CLOCK_PERIOD_S, lambda: self._publisher.publish_clock(self.time_ns))
        for row, (start, uav) in enumerate(zip(starts, self.uavs.values(), strict=True)):
            kind = self.scenario.types[start.type_name]
            self._fleet.set_command_timeout(kind.flight.command_timeout_s, row)
            open_commands(self.graph, uav)
            if start.takes_off:
                uav.take_off()
        context = Context(self.graph, self._engine, lambda: self.time_ns)
        for start in starts:
            for k, entry in enumerate(self.scenario.types[start.type_name].nodes):
                where = f"{self.scenario.name}: types.{start.type_name}.nodes[{k}]"
                self.nodes.append(
                    start_node(entry, context, f"/{start.name}", where, self.scenario.folder)
                )

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


def _make_fleet(scenario: Scenario, starts: tuple[Start, ...]) -> Fleet:
    return Fleet(
        [start.airframe for start in starts],
        np.array([start.position_map for start in starts]),
        np.array([start.attitude for start in starts]),
        dt_ns=1_000_000_000 // scenario.physics.rate_hz,
        on_contact=scenario.physics.on_contact,
        names=[start.name for start in starts],
        mode=[FlightMode.LANDED if start.on_ground else FlightMode.HOLD for start in starts],
    )


def _add_bodies(scene: Scene, starts: tuple[Start, ...]) -> None:
    kinds = {start.airframe.name: start.airframe for start in starts}
    order = list(kinds)
    scene.set_bodies(
        [body_shape(airframe) for airframe in kinds.values()],
        [order.index(start.airframe.name) for start in starts],
    )


def _make_publisher(graph: Graph, fitted: list[Fitted]) -> GraphPublisher:
    publisher = GraphPublisher(graph)
    for sensor in fitted:
        if sensor.lidar is not None:
            publisher.announce_lidar(sensor.id, sensor.lidar, sensor.topic, sensor.mount)
        else:
            publisher.announce(sensor.id, _RESULT_OF[sensor.spec.kind], sensor.mount)
        if sensor.mount.nods:
            publisher.announce(sensor.id, JointAngles, sensor.mount)
    return publisher


def _slice_steps(slice_ns: int | None, dt_ns: int) -> int:
    """Physics steps between two looks at the wall clock."""
    return 100 if slice_ns is None else max(1, slice_ns // dt_ns)
