"""Advances fleet, scene and sensors on one integer clock, stage by stage."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Collection, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control.fleet import Fleet
from volery.core.clock import NS_PER_S, Schedule, ns_from_s, s_from_ns
from volery.core.errors import CommandError
from volery.engine import event_collection
from volery.engine.actor_contacts import ActorShapes
from volery.engine.collisions import BOUNCE, CRASH, Collisions
from volery.engine.command_queue import CommandQueue, CommandTime, Repeats
from volery.engine.events import Event, EventKind
from volery.engine.fleet_resizing import common_rows, continue_bank
from volery.engine.lock_step import Partner
from volery.engine.one_shot_timers import OneShotTimers
from volery.engine.scheduler import Scheduler
from volery.engine.sensor_restart import Streams, restart_sensors
from volery.engine.stages import STAGES, Tick, take_commands
from volery.engine.state_check import StateCheck
from volery.sensors.bank import Bank
from volery.sensors.faults import FaultTable
from volery.sensors.samples import Samples
from volery.world.scene import Scene, Solid
from volery.world.terrain import Terrain
from volery.world.weather import Gust, Weather

if TYPE_CHECKING:
    from volery.engine.estimation import Estimation

_MAX_STEPS_PER_TICK = 50
"""The pose history holds 64 steps; its readers must not miss one."""


class SensorBank(Bank, Protocol):
    """All sensors of one kind, model, rate and phase, as used by the engine.

    Besides the methods of `Bank` (`sample`, `get_state`, `set_state`, `reset`), sensors can fail:
    `faults.set(row, kind, value)` takes effect at the next measurement.
    """

    @property
    def faults(self) -> FaultTable:
        """Faults of the sensors, row by row."""

    @property
    def wanted(self) -> Callable[[], bool] | None:
        """Returns whether the next measurement has receivers; None: it is always made."""

    def sample_rows(self, rows: NDArray[np.int64], k: int, time_ns: int, fleet: Fleet) -> Samples:
        """Returns what `sample` returns for the sensors `rows` (R,); others may have anything."""


class Sink(Protocol):
    """Receives samples and events."""

    def advanced(self, first_step: int, last_step: int) -> None:
        """Called when physics steps first..last have been computed."""

    def sampled(self, samples: Samples) -> None:
        """Called with the samples of a bank."""

    def happened(self, event: Event) -> None:
        """Called with each event."""

    def deliver(self) -> None:
        """Delivers all queued messages."""


class Division(Protocol):
    """Keeps the machines of a divided run in lock step; each has an engine of its own."""

    @property
    def at_barrier(self) -> bool:
        """Whether all machines are at the present step, so that commands may be executed."""

    def begin_tick(self, last_step: int) -> int:
        """Takes over what others have published, at a barrier of the machines.

        last_step: the step at which the tick ends at the latest. Returns that of the next barrier,
        if it is earlier.
        """

    def exchange_responses(self) -> None:
        """Exchanges responses to sensors' messages at a barrier, before timers are called."""

    def end_tick(self) -> None:
        """Passes on what this machine has published, at a barrier of the machines."""

    def end_round(self) -> None:
        """Called when the effects of some commands of clients have been delivered."""


class Engine:
    """Advances the simulation in lock step; see `stages.STAGES` for the order."""

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
        num_envs: int = 1,
        estimation: Estimation | None = None,
        inbox: CommandQueue | None = None,
        fuses_ticks: bool = False,
    ) -> None:
        self.fleet = fleet
        self.scene = scene
        self.ground = terrain
        self.terrain = terrain.grid
        self.sink = sink
        self.inbox = inbox or CommandQueue()
        self.fuses_ticks = fuses_ticks
        """Whether a tick goes on after events, and after distance queries that find no contact also
        in a run with `until`, which is then asked less often; states and events are the same."""
        self.while_waiting: Callable[[], bool] = lambda: True
        """Called repeatedly while waiting for a lock-step partner; returns whether the run
        continues."""
        self.is_broken_off = False
        """Whether the end of the run aborted the last barrier with lock-step partners."""
        self.division: Division | None = None
        """Other machines that share the run; None: it is not divided."""
        self.repeats: Repeats | None = None
        """Recorded commands to replay."""
        self.turn = 0
        """Turn of the current moment; see `CommandTime`."""
        self._commanded = False
        self.stands = True
        """Whether the state is consistent, so that it can be saved and restored."""
        self.dt_ns = fleet.dt_ns
        self._new_events: list[Event] = []
        self.num_events = 0
        """Number of events that `collect_events` has returned so far."""
        self.names = names
        """Names of the UAVs, in fleet order."""
        self._response = CRASH if crash_on_contact else BOUNCE
        self.actors = scene.actors
        """Actors of the world; None without any."""
        self._looks = None if self.actors is None else ActorShapes(self.actors)
        self.collisions = self._new_collisions(fleet, names, num_envs)
        self.state_check = StateCheck(fleet)
        self.banks = tuple(banks)
        self.estimation = estimation
        """Estimators that use the sensors' measurements; None without any."""
        self.sensor_agenda = self._new_agenda(self.banks, after_step=-1)
        self.timer_agenda: Scheduler[Callable[[], Any]] = Scheduler(self.dt_ns)
        self.partner_agenda: Scheduler[Partner] = Scheduler(self.dt_ns)
        self.deadlines = OneShotTimers(self.dt_ns)
        self.stage_seconds = {stage.__name__: 0.0 for stage in STAGES}
        """Time spent in each stage so far, s, by `stage_clock`."""
        self.stage_clock: Callable[[], float] = time.perf_counter
        """Clock of the stages; `time.thread_time` costs a system call each time."""

    @property
    def time_ns(self) -> int:
        """Simulated time, ns."""
        return self.fleet.step * self.dt_ns

    @property
    def moment(self) -> CommandTime:
        """Current moment, between two ticks or in a barrier."""
        return CommandTime(self.fleet.step, self.turn)

    def count_command(self) -> None:
        """Counts a command of this moment that may change results."""
        self._commanded = True

    def set_weather(self, weather: Weather) -> None:
        """Sets the weather from the next guidance tick on."""
        self.fleet.set_weather(weather)

    def gust_now(
        self, amplitude_map: tuple[float, float, float], rise_s: float, lasts_s: float = math.inf
    ) -> None:
        """Starts a 1-cosine gust of `amplitude_map` (3,) m/s now, with duration `lasts_s`."""
        now_s = s_from_ns(self.time_ns)
        self.fleet.add_gust(Gust(amplitude_map, now_s, rise_s, now_s + lasts_s))

    def every(
        self,
        period_s: float,
        callback: Callable[[], Any],
        *,
        wanted: Callable[[], bool] | None = None,
    ) -> None:
        """Calls `callback` every period of simulated time, first after one period.

        Skips calls while `wanted()` is false, for which no tick ends.
        """
        schedule = self._from_now(period_s)
        self.timer_agenda.add(callback, schedule, after_step=self.fleet.step, wanted=wanted)

    def forget(self, callback: Callable[[], Any]) -> None:
        """Stops calling a `callback` that was passed to `every`."""
        self.timer_agenda.remove(callback)

    def at(self, time_ns: int, action: Callable[[], Any]) -> None:
        """Calls `action` once at simulated `time_ns`, or at once if that has passed."""
        self.deadlines.add(max(time_ns, self.time_ns), action)

    def wait_for(self, partner: Partner, period_s: float) -> None:
        """Waits for `partner` every period of simulated time, first after one period.

        With `meets_at_start`, the first barrier is at time 0, if the run has not started.
        """
        at_start = partner.meets_at_start and self.fleet.step == 0
        after_step = -1 if at_start else self.fleet.step
        self.partner_agenda.add(partner, self._from_now(period_s), after_step=after_step)

    def advance_to(
        self, step: int, *, until: Callable[[], bool] | None = None, in_pieces: bool = False
    ) -> None:
        """Runs ticks up to `step`, including everything due at that step.

        until: called after each tick; ends the run when true. Its result must depend on the
        simulated world only, so that the end does not depend on how a run is divided. in_pieces:
        the caller calls again for the rest, so a tick that restored an earlier state ends the
        piece, because `step` may now be far away.
        """
        while self.fleet.step < step or self._due_step() <= self.fleet.step:
            if until is not None and until():
                return
            before = self.fleet.step
            # The first tick delivers what was published before the run: it ends at the first query.
            fuses = self.fuses_ticks or (until is None and before > 0)
            self._run_tick(Tick(step, fuses=fuses))
            if in_pieces and (self.fleet.step < before or self.is_broken_off):
                return

    def process_commands(self, idle_s: float = 0.0) -> None:
        """Executes posted commands and delivers what they published; called between ticks.

        idle_s: wall time to spare, in which clients may exceed their budget; see `CommandQueue`.
        """
        self.inbox.serve(self._hand_out, idle_s)
        self.take_repeats()

    def take_repeats(self) -> None:
        """Replays the recorded commands of this moment, in the recorded rounds."""
        while self.repeats is not None and self.repeats.take():
            self._hand_out()

    def _hand_out(self) -> None:
        """Ends a round of commands."""
        stood, self.stands = self.stands, False
        try:
            self.sink.deliver()
        finally:
            self.stands = stood
        if self.division is not None:
            self.division.end_round()
        self.turn += self._commanded
        self._commanded = False

    def wait(self, timeout_s: float) -> None:
        """Waits for commands or a `wake`, at most `timeout_s` of wall time."""
        comes = self.repeats is not None and self.repeats.next_step() == self.fleet.step
        self.inbox.wait(0.0 if comes else timeout_s)

    def goes_on(self) -> bool:
        """Returns whether the run continues, while waiting for a lock-step partner."""
        return self.while_waiting()

    def wake(self) -> None:
        """Ends a `wait`; callable from any thread."""
        self.inbox.wake()

    def horizon(self, step: int) -> int:
        """Returns the last step of a tick that must not pass `step`."""
        now = self.fleet.step
        wanted = None if self.repeats is None else self.repeats.next_step()
        step = min(step, self._due_step(), step if wanted is None else wanted)
        return min(max(step, now), now + _MAX_STEPS_PER_TICK)

    def note(self, uav: int, kind: EventKind, detail: str) -> None:
        """Adds an event of a UAV, at the current time."""
        x, y, z = self.fleet.state.position_map[uav].tolist()
        self._new_events.append(
            Event(self.time_ns, self.names[uav], kind, (x, y, z), 0.0, detail=detail)
        )

    def note_world(self, detail: str) -> None:
        """Adds an event about a change of the world."""
        nowhere = (0.0, 0.0, 0.0)
        self._new_events.append(
            Event(self.time_ns, "", EventKind.WORLD, nowhere, 0.0, detail=detail)
        )

    def replace_solids(self, solids: Sequence[Solid]) -> None:
        """Replaces the solids of the world from the next physics step on; see `Scene`."""
        self.collisions.look_again(self.scene.replace_solids(solids))

    def set_actor_pose(self, row: int, pose: ArrayLike, velocity: ArrayLike) -> None:
        """Sets an actor's pose (7,) and velocity (3,) m/s, map, from now on.

        Raises `CommandError` if the actor follows a path of its own.
        """
        if self.actors is None:
            raise CommandError("this world has no actors")
        self.actors.set_pose(row, self.time_ns, pose, velocity)
        self.collisions.look_at_actors()

    def collect_events(self) -> list[Event]:
        """Returns the events since the last call, oldest first."""
        if self.fleet.has_events:
            self._new_events += event_collection.drain(self.fleet, self.names)
        if not self._new_events:
            return []
        events = sorted(self._new_events, key=lambda event: event.time_ns)
        self._new_events.clear()
        self.num_events += len(events)
        return events

    def restart_sensors(
        self, uavs: NDArray[np.int64], streams: Streams
    ) -> list[tuple[Samples, NDArray[np.int64]]]:
        """Restarts the sensors of `uavs`, and the estimates that use them.

        See `engine.sensor_restart`; the random stream of an estimate is that of sensor `odom`.
        """
        if self.estimation is not None:
            self.estimation.restart(streams.of_estimates(uavs))
        return restart_sensors(self.sensor_agenda, self.banks, self.fleet, uavs, streams)

    def regroup(
        self,
        fleet: Fleet,
        banks: Sequence[SensorBank],
        names: tuple[str, ...],
        estimation: Estimation | None,
        going_on: Collection[str],
    ) -> Callable[[], None]:
        """Continues with a fleet that has more or fewer UAVs; called between ticks.

        All parts are new, as at a start. The UAVs `going_on` keep their state, and so do their
        sensors and estimates; the others start now. An error leaves the engine as it was. Returns a
        function that continues with the fleet of before, to be called before the next tick.
        """
        self._new_events += event_collection.drain(self.fleet, self.names)
        pairs = common_rows(names, self.names, going_on)
        fleet.continue_from(self.fleet, pairs)
        step = self.fleet.step
        measured = (self.sensor_agenda.next_step() or step) > step if step else False
        collisions = self._new_collisions(fleet, names, num_envs=1)
        collisions.continue_from(self.collisions, pairs)
        agenda = self._new_agenda(banks, after_step=step if measured else step - 1)
        for bank in banks:
            continue_bank(bank, self.banks, going_on)
        if estimation is not None and self.estimation is not None:
            estimation.continue_from(self.estimation, pairs)
        check = StateCheck(fleet)
        before = (self.fleet, self.names, self.banks, self.estimation)
        helpers = (self.state_check, self.collisions, self.sensor_agenda)

        def undo() -> None:
            self.fleet, self.names, self.banks, self.estimation = before
            self.state_check, self.collisions, self.sensor_agenda = helpers

        self.fleet, self.names, self.banks, self.estimation = fleet, names, tuple(banks), estimation
        self.state_check, self.collisions, self.sensor_agenda = check, collisions, agenda
        return undo

    # ------------------------------------------------------------------------------ snapshot

    def get_state(self) -> dict[str, Any]:
        """Returns the state of fleet, collisions, sensors and timers; called between ticks."""
        return {
            "fleet": self.fleet.get_state(),
            "collisions": self.collisions.get_state(),
            "banks": [bank.get_state() for bank in self.banks],
            "due": [part.get_state() for part in self._due],
            "estimation": None if self.estimation is None else self.estimation.get_state(),
            "actors": None if self.actors is None else self.actors.get_state(),
            "new_events": list(self._new_events),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a saved state of this engine."""
        self.turn = 0
        self.fleet.set_state(state["fleet"])
        self.collisions.set_state(state["collisions"])
        for bank, kept in zip(self.banks, state["banks"], strict=True):
            bank.set_state(kept)
        for part, kept in zip(self._due, state["due"], strict=True):
            part.set_state(kept)
        if self.estimation is not None:
            self.estimation.set_state(state["estimation"])
        if self.actors is not None:
            self.actors.set_state(state["actors"])
        self._new_events[:] = state["new_events"]

    # ------------------------------------------------------------------------------------- internal

    @property
    def _due(self) -> tuple[Scheduler[Any] | OneShotTimers, ...]:
        return self.sensor_agenda, self.timer_agenda, self.partner_agenda, self.deadlines

    def _from_now(self, period_s: float) -> Schedule:
        return Schedule(Fraction(NS_PER_S, ns_from_s(period_s)), self.time_ns)

    def _new_collisions(self, fleet: Fleet, names: tuple[str, ...], num_envs: int) -> Collisions:
        emit = self._new_events.append
        return Collisions(
            fleet,
            self.scene,
            names,
            self._response,
            emit,
            num_envs=num_envs,
            looks=self._looks,
        )

    def _new_agenda(self, banks: Sequence[SensorBank], *, after_step: int) -> Scheduler[SensorBank]:
        agenda: Scheduler[SensorBank] = Scheduler(self.dt_ns)
        for bank in banks:
            agenda.add(
                bank,
                bank.schedule,
                lag_ns=bank.lag_ns,
                after_step=after_step,
                wanted=bank.wanted,
            )
        return agenda

    def _due_step(self) -> int:
        nearest = 1 << 62
        for part in self._due:
            step = part.next_step()
            if step is not None and step < nearest:
                nearest = step
        look_ns = self.collisions.next_look_ns
        return nearest if look_ns is None else min(nearest, -(-look_ns // self.dt_ns))

    def _run_tick(self, tick: Tick) -> None:
        clock = self.stage_clock
        before = clock()
        try:
            for stage in STAGES:
                self.stands = stage is take_commands
                stage(self, tick)
                after = clock()
                self.stage_seconds[stage.__name__] += after - before
                before = after
        except (ArithmeticError, ValueError):
            self.state_check.look()  # NaN breaks its readers: report the cause
            raise
        finally:
            self.stands = True
            self.turn += 1
