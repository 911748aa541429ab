"""A recorded log in the place of a simulation: a graph that tells again what was told then.

    with LogPlayer(Path("flight.mcap")) as player, BridgeHost(player.gateway) as bridges:
        bridges.open(RosbridgeServer())
        player.run()

It has its own clock, the log's, which can be paused, paced and put anywhere. Nothing is simulated:
what clients command has no effect.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any

from volery.bridges.logs.playback import Playback
from volery.bridges.logs.recorded_flight import RecordedScenario, origin_of
from volery.core.clock import NS_PER_S, ns_from_s, s_from_ns
from volery.core.errors import CommandError, RecordingError, VoleryError
from volery.engine.call_budget import CallBudget
from volery.engine.command_queue import CommandQueue
from volery.graph.graph import Graph
from volery.graph.messages import Clock, time_from_ns
from volery.graph.session import Gateway
from volery.runtime.build.geometry import Geometry
from volery.runtime.build.worlds import geometry_of
from volery.runtime.monitoring.progress import Progress
from volery.runtime.replay.scenario_record import scenario_of
from volery.runtime.services.player import PlayerServices, RunState
from volery.runtime.services.worlds import OnLoad
from volery.scenario import library
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.schema import Scenario

_SLICE_S = 0.004
"""Wall time between two looks at what is due, while it plays."""
_CLOCK_S = 0.02
_STATE_S = 0.2
"""Wall time between two messages."""
_SLACK_S = 0.25
"""Who falls behind by more does not rush afterwards to catch up."""
_STEP_NS = 1_000_000
"""A physics step where the log does not tell of its scenario."""
_GLANCE_S = 0.05
_NEWCOMERS = "new subscribers"


class LogPlayer:
    """Plays the log at `path` on a graph of its own.

    `speed` is a factor of real time, None plays as fast as possible; with `loop` it begins again at
    the end, else it pauses there. `on_load` is called with the name of a scenario that a client
    wants to see flown instead, or with None where it wants no world; `on_close` where a client
    wants to return to what was flown before. `shelf` has what there is to choose from. `own`: the
    user's own scenario of the log's flight, for files that its world needs; unless given, one of
    that name of the shelf; else they lie beside the log. Methods belong to one thread, which calls
    `wait` or `run`; others use `Gateway.post`. Raises `RecordingError` where there is no log, or
    nothing in it.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        speed: float | None = 1.0,
        loop: bool = False,
        paused: bool = False,
        on_load: OnLoad | None = None,
        on_close: Callable[[], None] | None = None,
        shelf: ScenarioCatalog | None = None,
        own: Scenario | None = None,
    ) -> None:
        _check_speed(speed)
        self.path = Path(path)
        self._playback = Playback(self.path)
        self._inbox = CommandQueue()
        self.graph = Graph(lambda: self._playback.now_ns, self._inbox.post)
        self.gateway = Gateway(
            self.graph,
            self._inbox.post,
            open_queue=lambda: self._inbox.open_queue().post,
            is_busy=lambda: self._is_busy,
            is_late=lambda: self._is_late,
        )
        self.loop = loop
        self.quitting = False
        """Whether somebody called `quit`."""
        self.origin = self._known_origin()
        """What was flown, as the log tells; None where it does not."""
        self.scenario: Scenario | None = self._known_scenario(own, shelf)
        """The scenario that was flown, for its world; None where that is not known."""
        self._paused = paused
        self._speed = speed
        self._base_ns, self._base_wall = 0, 0.0
        """It was, or is, to be at this time at that wall time."""
        self._is_late = False
        """Whether it does not keep its pace at present."""
        self._budget = CallBudget()
        """For reading the log again, for all new subscribers together."""
        self._clock = self.graph.advertise("/clock", Clock)
        self._clock_due = self._state_due = 0.0
        self._playback.open(self.graph)
        self._services = PlayerServices(self, on_load, shelf, on_close)
        self._rebase()

    # -------------------------------------------------------------------------------------- time

    @property
    def time_ns(self) -> int:
        """Where in the log it is."""
        return self._playback.position_ns

    @property
    def time_s(self) -> float:
        """Where in the log it is."""
        return s_from_ns(self.time_ns)

    @property
    def name(self) -> str:
        """Of the log's file."""
        return self.path.name

    @property
    def start_s(self) -> float:
        """Beginning of the log."""
        return s_from_ns(self._playback.start_ns)

    @property
    def end_s(self) -> float:
        """End of the log."""
        return s_from_ns(self._playback.end_ns)

    @property
    def finished(self) -> bool:
        """Whether it stands at the end, or somebody quit."""
        return self.quitting or self.time_ns >= self._playback.end_ns

    @cached_property
    def geometry(self) -> Geometry | None:
        """What stood in the world at the beginning; None where the scenario is not known."""
        return None if self.scenario is None else geometry_of(self.scenario)

    @property
    def paused(self) -> bool:
        """Whether it stands still."""
        return self._paused

    @property
    def speed(self) -> float | None:
        """Factor of real time, None for as fast as possible."""
        return self._speed

    @property
    def state(self) -> RunState:
        """As `simulation_interfaces` names it: stopped at the start."""
        if self.quitting:
            return RunState.QUITTING
        if not self._paused:
            return RunState.PLAYING
        return RunState.STOPPED if self.time_ns == self._playback.start_ns else RunState.PAUSED

    # ---------------------------------------------------------------------------------- steering

    def pause(self) -> None:
        """Stand still."""
        self._paused, self._is_late = True, False
        self._tell_soon()

    def resume(self) -> None:
        """Go on; at the end, begin anew."""
        if self.finished:
            self.seek(self.start_s)
        self._paused = False
        self._rebase()
        self._tell_soon()

    def set_speed(self, speed: float | None) -> None:
        """Play at `speed` times real time from here on, None for as fast as possible."""
        _check_speed(speed)
        self._speed = speed
        self._rebase()
        self._tell_soon()

    def seek(self, time_s: float) -> None:
        """Go to a time of the log, and tell once more what was told last before it."""
        if not math.isfinite(time_s):
            raise CommandError(f"a time must be finite, not {time_s}")
        self._playback.seek(ns_from_s(min(max(time_s, self.start_s), self.end_s)))
        self._rebase()
        self._tell_soon()

    def single_step(self, steps: int = 1) -> None:
        """Go on by physics steps of the recorded flight. `CommandError` unless it is paused."""
        if not self._paused:
            raise CommandError("single steps are made while paused; call pause() first")
        if steps < 1:
            raise CommandError(f"a single step is at least 1 step, not {steps}")
        scenario = self.scenario
        step_ns = _STEP_NS if scenario is None else round(NS_PER_S / scenario.physics.rate_hz)
        until_ns = self.time_ns + steps * step_ns
        while not self._playback.advance(until_ns):
            self.graph.deliver()
        self._tell_soon()

    def quit(self) -> None:
        """End `run` as soon as may be."""
        self.quitting = True
        self._inbox.wake()

    def use_low_latency(self) -> None:
        """As of `Simulation`; here what clients ask is done at once anyway."""

    # --------------------------------------------------------------------------------- its owner

    def run(
        self,
        seconds: float | None = None,
        *,
        on_progress: Callable[[Progress], None] | None = None,
    ) -> None:
        """Play and serve for `seconds` of wall time, None: until somebody quits.

        `on_progress` is called about twenty times a second, also while it stands still.
        """
        begun = time.perf_counter()
        until = math.inf if seconds is None else begun + seconds
        start_s = self.time_s
        while not self.quitting and (left := until - time.perf_counter()) > 0.0:
            self.wait(min(left, _GLANCE_S))
            if on_progress is not None:
                wall_s = time.perf_counter() - begun
                span_s = self.end_s - self.start_s
                on_progress(Progress(self.time_s - start_s, span_s, wall_s, self._paused))

    def wait(self, timeout_s: float) -> None:
        """Play and serve clients for so long."""
        until = time.perf_counter() + timeout_s
        while True:
            self._serve()
            self._show_to_newcomers()
            self._play()
            self._tell()
            self.graph.deliver()
            left = until - time.perf_counter()
            if left <= 0.0 or self.quitting:
                return
            self._inbox.wait(min(left, _STATE_S if self._paused else self._pause_s))

    def close(self) -> None:
        """Close the log."""
        self.quitting = True
        self._playback.close()

    def __enter__(self) -> LogPlayer:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    # ------------------------------------------------------------------------------------ inside

    @property
    def _pause_s(self) -> float:
        """Between two looks while it plays: none as fast as possible."""
        return 0.0 if self._speed is None else _SLICE_S

    @property
    def _is_busy(self) -> bool:
        """Whether it has no time to spare for clients."""
        return not self._paused and (self._is_late or self._speed is None)

    @property
    def _idle_s(self) -> float:
        """Wall time that clients may take now without being charged for it."""
        if self._paused:
            return math.inf
        return 0.0 if self._is_busy else _SLICE_S

    def _serve(self) -> None:
        """Do what clients have asked for."""
        self._inbox.serve(self.graph.deliver, self._idle_s)

    def _show_to_newcomers(self) -> None:
        """Publish to new subscribers what was published last, as soon as the budget has it."""
        self._budget.earn()
        if self._budget.may_spend(_NEWCOMERS):
            before_s = time.thread_time()
            self._playback.show_to_newcomers()
            self.graph.deliver()
            self._budget.spend(_NEWCOMERS, time.thread_time() - before_s)

    def _play(self) -> None:
        """Publish what is due, at most a slice of wall time long."""
        if self._paused:
            return
        begun = time.perf_counter()
        due_ns = self._due_ns(begun)
        over = self._playback.advance(due_ns)
        while not over and time.perf_counter() - begun < _SLICE_S:
            self.graph.deliver()
            over = self._playback.advance(due_ns)
        self._is_late = not over and self._speed is not None
        if over and self.time_ns >= self._playback.end_ns:
            if self.loop:
                self.seek(self.start_s)
            else:
                self.pause()

    def _due_ns(self, now: float) -> int:
        """How far it is to have come by now."""
        if self._speed is None:
            return self._playback.end_ns
        due_ns = self._base_ns + round((now - self._base_wall) * self._speed * NS_PER_S)
        late_ns = due_ns - self.time_ns
        slack_ns = round(_SLACK_S * self._speed * NS_PER_S)
        if late_ns > slack_ns:
            due_ns = self.time_ns + slack_ns
            self._base_ns, self._base_wall = due_ns, now
        return due_ns

    def _rebase(self) -> None:
        """Count due times from here and now."""
        self._base_ns, self._base_wall = self.time_ns, time.perf_counter()

    def _tell(self) -> None:
        """Publish clock and state where their wall time has come."""
        now = time.perf_counter()
        if now >= self._clock_due and (not self._paused or not self._clock_due):
            self._clock_due = now + _CLOCK_S
            self._clock.publish(Clock(time_from_ns(self._playback.now_ns)))
        if now >= self._state_due:
            self._state_due = now + _STATE_S
            self._services.tell_state()

    def _tell_soon(self) -> None:
        self._clock_due = self._state_due = 0.0

    def _known_origin(self) -> RecordedScenario | None:
        with suppress(RecordingError):
            return origin_of(self._playback.log)
        return None

    def _known_scenario(
        self, own: Scenario | None, shelf: ScenarioCatalog | None
    ) -> Scenario | None:
        origin, folder = self.origin, self.path.parent
        if own is not None and origin is not None:
            return scenario_of(origin, own, folder=folder)  # another one is a mistake of the user's
        with suppress(VoleryError):
            if origin is not None:
                return scenario_of(origin, _of_shelf(shelf, origin.name), folder=folder)
        return None

    def describe(self) -> dict[str, Any]:
        """The log, by the names of `volery_interfaces/srv/PlayerInfo`."""
        played, topics = self._playback, self._playback.topics
        return {
            "file": self.path.name,
            "format": played.log.format,
            "size": played.log.size,
            "topics": [topic.name for topic in topics],
            "types": [topic.msgtype for topic in topics],
            "counts": [topic.messages for topic in topics],
            "refused": list(played.refused),
            "reasons": list(played.refused.values()),
            "problem": played.problem,
            "scenario": "" if self.origin is None else self.origin.name,
            "seed": 0 if self.origin is None else self.origin.seed,
        }


def _of_shelf(shelf: ScenarioCatalog | None, name: str) -> Scenario | None:
    """A scenario with files of its own beside it; shipped ones have none."""
    if shelf is None or name in library.names() or name not in shelf.names():
        return None
    with suppress(VoleryError):
        return shelf.load(name)
    return None


def _check_speed(speed: float | None) -> None:
    if speed is not None and not (math.isfinite(speed) and speed > 0.0):
        raise CommandError(f"speed must be a positive factor of real time, not {speed}")
