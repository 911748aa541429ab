"""The engine: a fleet, its scene and sensors on one integer clock, folded through the stages."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Any, Protocol

from volery.control.fleet import Fleet
from volery.core.clock import NS_PER_S, Schedule, ns_from_s, s_from_ns
from volery.engine import flight_log
from volery.engine.agenda import Agenda
from volery.engine.collisions import BOUNCE, CRASH, Collisions
from volery.engine.commands import Inbox
from volery.engine.events import Event
from volery.engine.stages import STAGES, Tick
from volery.sensors.samples import Samples, SensorId
from volery.world.scene import Scene
from volery.world.terrain import Terrain
from volery.world.weather import Gust, Weather

_MOST_STEPS_A_TICK = 50
"""The history of poses holds 64 steps; whoever reads along must not miss one."""


class SensorBank(Protocol):
    """All sensors of one kind, model, rate and phase: sampled together."""

    @property
    def name(self) -> str:
        """Kind of the sensors."""

    @property
    def schedule(self) -> Schedule:
        """When they measure."""

    @property
    def lag_ns(self) -> int:
        """How long after its instant a measurement is complete (a LIDAR's sweep)."""

    @property
    def sensors(self) -> tuple[SensorId, ...]:
        """Which they are."""

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> Samples:
        """Measurement number k."""


class Sink(Protocol):
    """Where measurements and events go."""

    def advanced(self, first_step: int, last_step: int) -> None:
        """Physics steps first..last have been computed."""

    def sampled(self, samples: Samples) -> None:
        """Sensors have measured."""

    def happened(self, event: Event) -> None:
        """Something happened."""

    def deliver(self) -> None:
        """Hand everything out."""


class Engine:
    """Advances everything in lock step; see `stages.STAGES` for the order."""

    def __init__(
        self,
        fleet: Fleet,
        scene: Scene,
        terrain: Terrain,
        banks: Sequence[SensorBank],
        names: tuple[str, ...],
        sink: Sink,
        *,
        crash_on_contact: bool,
    ) -> None:
        self.fleet = fleet
        self.scene = scene
        self.terrain = terrain.grid
        self.sink = sink
        self.inbox = Inbox()
        self.dt_ns = fleet.dt_ns
        self._new_events: list[Event] = []
        self._names = names
        response = CRASH if crash_on_contact else BOUNCE
        self.collisions = Collisions(fleet, scene, names, response, self._new_events.append)
        self.sensor_agenda: Agenda[SensorBank] = Agenda(self.dt_ns)
        for bank in banks:
            self.sensor_agenda.add(bank, bank.schedule, lag_ns=bank.lag_ns)
        self.timer_agenda: Agenda[Callable[[], Any]] = Agenda(self.dt_ns)
        self.stage_seconds = {stage.__name__: 0.0 for stage in STAGES}

    @property
    def time_ns(self) -> int:
        """Simulated time."""
        return self.fleet.step * self.dt_ns

    def set_weather(self, weather: Weather) -> None:
        """Let `weather` blow from the next guidance tick on."""
        self.fleet.set_weather(weather)

    def gust_now(
        self, amplitude_map: tuple[float, float, float], rise_s: float, lasts_s: float = math.inf
    ) -> None:
        """Let a 1-cosine gust of `amplitude_map` (3,) m/s begin now, over after `lasts_s`."""
        now_s = s_from_ns(self.time_ns)
        self.fleet.add_gust(Gust(amplitude_map, now_s, rise_s, now_s + lasts_s))

    def every(self, period_s: float, callback: Callable[[], Any]) -> None:
        """Call `callback` each period of simulated time, first after one period."""
        period_ns = ns_from_s(period_s)
        schedule = Schedule(Fraction(NS_PER_S, period_ns), self.time_ns)
        self.timer_agenda.add(callback, schedule, after_step=self.fleet.step)

    def advance_to(self, step: int, *, until: Callable[[], bool] | None = None) -> None:
        """Run ticks until `step` is reached and everything due there has fired.

        `until` is asked after each tick and ends the run there: the answer must follow from the
        simulated world alone, so that the end does not depend on how a run is sliced.
        """
        while self.fleet.step < step or self._due_step() <= self.fleet.step:
            if until is not None and until():
                return
            horizon = max(min(step, self._due_step()), self.fleet.step)
            self._run_tick(Tick(min(horizon, self.fleet.step + _MOST_STEPS_A_TICK)))

    def collect_events(self) -> list[Event]:
        """Events since the last call, oldest first."""
        self._new_events += flight_log.drain(self.fleet, self._names)
        events = sorted(self._new_events, key=lambda event: event.time_ns)
        self._new_events.clear()
        return events

    def _due_step(self) -> int:
        steps = (self.sensor_agenda.next_step(), self.timer_agenda.next_step())
        return min((s for s in steps if s is not None), default=1 << 62)

    def _run_tick(self, tick: Tick) -> None:
        before = time.perf_counter()
        for stage in STAGES:
            stage(self, tick)
            after = time.perf_counter()
            self.stage_seconds[stage.__name__] += after - before
            before = after
