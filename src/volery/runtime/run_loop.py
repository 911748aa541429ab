"""Runs a simulation in pieces of simulated time and processes clients in between."""

from __future__ import annotations

import math
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

from volery.core.clock import ns_from_s, s_from_ns
from volery.engine.engine import Engine
from volery.engine.pacing import Pacer
from volery.runtime.monitoring.progress import Progress, ProgressPublisher


class StopCondition(Protocol):
    """Ends a run when it becomes true."""

    def __call__(self) -> bool:
        """Returns whether the run ends here; called after each tick."""

    def next_check(self, step: int) -> int:
        """Returns the next step, after `step`, at which a tick must end for the condition."""


class RunLoop:
    """Advances `engine` at the rate of `pacer` until `duration_s`, or until `has_ended()`.

    `has_ended` must depend on the simulated world alone. With `past_end` or `replays` set, the
    duration does not end the run.
    """

    def __init__(
        self, engine: Engine, pacer: Pacer, duration_s: float, has_ended: Callable[[], bool]
    ) -> None:
        self._engine = engine
        self._pacer = pacer
        self._duration_s = duration_s
        self._has_ended = has_ended
        self.owed_ns = 0
        """Simulated time, ns, requested from runs but shorter than a physics step, still due."""
        self.quitting = False
        """Whether the present and all later runs end at once."""
        self.past_end = False
        """Whether runs continue past the scenario's end, until another state is restored."""
        self.replays = False
        """Whether recorded commands determine the end of the run."""
        self.thread: int | None = None
        """Thread that advances the simulation now; None: no run is in progress."""
        self.owner = threading.get_ident()
        """Thread that has made or last advanced the simulation."""

    @contextmanager
    def occupied(self) -> Iterator[None]:
        """Records that the calling thread advances the simulation."""
        before, self.thread = self.thread, threading.get_ident()
        self.owner = self.thread
        try:
            yield
        finally:
            self.thread = before

    @property
    def remaining_s(self) -> float:
        """Simulated time until the scenario's end, s; infinite where the run has none."""
        if self._has_no_end:
            return math.inf
        return max(0.0, self._duration_s - s_from_ns(self._engine.time_ns))

    @property
    def finished(self) -> bool:
        """Whether the run has reached its end or was quit."""
        return self.quitting or self._has_come()

    def quit(self) -> None:
        """Ends the present run, and all later ones at their start; thread-safe."""
        self.quitting = True
        self._pacer.drop_steps("the simulation quits")
        self._pacer.wake()

    def run(
        self,
        seconds: float | None,
        speed: float | None,
        on_progress: Callable[[Progress], None] | None,
        look: Callable[[], None],
    ) -> None:
        """Advances by `seconds`; None advances to the end.

        look: called between two pieces and repeatedly while the run is held; changes nothing.
        """
        with self.occupied():
            for _ in self.pieces(seconds, speed, on_progress, look):
                pass

    def pieces(
        self,
        seconds: float | None,
        speed: float | None,
        on_progress: Callable[[Progress], None] | None,
        look: Callable[[], None],
    ) -> Iterator[None]:
        """Runs like `run`, and yields after each piece and each moment of waiting."""
        if seconds is None:
            has_no_end = self._has_no_end
            now_s = s_from_ns(self._engine.time_ns)
            left = math.inf if has_no_end else self._duration_s - now_s
            return self._pieces(left, self._last_step, self._ends_here, speed, on_progress, look)
        end_step = self._engine.fleet.step + self._whole_steps(seconds)
        return self._pieces(seconds, lambda: end_step, None, speed, on_progress, look)

    def pieces_until(
        self,
        condition: StopCondition,
        seconds: float,
        speed: float | None,
        look: Callable[[], None],
    ) -> Iterator[None]:
        """Runs until `condition()`, by `seconds` at most, and yields like `pieces`."""
        engine = self._engine
        steps = sys.maxsize if math.isinf(seconds) else -(-ns_from_s(seconds) // engine.dt_ns)
        end_step = engine.fleet.step + steps

        def next_end() -> int:
            return min(end_step, condition.next_check(engine.fleet.step))

        if condition():
            return iter(())
        return self._pieces(seconds, lambda: end_step, condition, speed, None, look, next_end)

    def _pieces(
        self,
        left: float,
        find_end: Callable[[], int],
        until: Callable[[], bool] | None,
        speed: float | None,
        on_progress: Callable[[Progress], None] | None,
        look: Callable[[], None],
        next_end: Callable[[], int] | None = None,
    ) -> Iterator[None]:
        """Runs to step `find_end()`, each piece at most to `next_end()`."""
        engine, pacer = self._engine, self._pacer
        start_ns = engine.time_ns
        pacer.begin(speed, start_ns)
        progress = ProgressPublisher(on_progress, left, pacer)
        over = engine.fleet.step >= find_end() or self.quitting

        def while_waiting() -> bool:
            progress.report(s_from_ns(engine.time_ns) - s_from_ns(start_ns))
            return not self.quitting

        engine.while_waiting = while_waiting
        while not over:
            self._advance((next_end or find_end)(), until)
            look()
            over = engine.fleet.step >= find_end() or (until is not None and until())
            over = over or self.quitting
            while self._is_held() and not (over and pacer.paused):
                engine.process_commands(pacer.idle_s())
                look()
                progress.report(s_from_ns(engine.time_ns) - s_from_ns(start_ns))
                if self.quitting:
                    over = True
                    break
                yield
            progress.report(s_from_ns(engine.time_ns) - s_from_ns(start_ns), last=over)
            yield
        engine.state_check.look()
        if self.finished:
            pacer.drop_steps("the scenario has ended")

    def _is_held(self) -> bool:
        """Returns whether the run must wait; waits a moment unless commands are pending."""
        if self._engine.inbox.has_waiting:
            self._pacer.wake()
        return self._pacer.wait(self._engine.time_ns)

    def _ends_here(self) -> bool:
        """Returns whether the run has ended; a replay ends with its last command."""
        self._engine.take_repeats()
        return self._has_come()

    def _advance(self, end_step: int, until: Callable[[], bool] | None) -> None:
        fleet = self._engine.fleet
        steps = self._pacer.next_steps(fleet.dt_ns)
        if steps:
            before = fleet.step
            self._engine.advance_to(min(end_step, before + steps), until=until, in_pieces=True)
            self._pacer.made(max(0, min(fleet.step - before, steps)))

    @property
    def _has_no_end(self) -> bool:
        return self.past_end or self.replays

    def _has_come(self) -> bool:
        """Returns whether the duration is over or the world has ended the run."""
        if self.past_end:
            return False
        over = s_from_ns(self._engine.time_ns) >= self._duration_s and not self.replays
        return over or self._has_ended()

    def _last_step(self) -> int:
        """Returns the physics step at which the duration is over."""
        if self._has_no_end:
            return sys.maxsize
        return -(-ns_from_s(self._duration_s) // self._engine.dt_ns)

    def _whole_steps(self, seconds: float) -> int:
        steps, self.owed_ns = divmod(self.owed_ns + ns_from_s(seconds), self._engine.dt_ns)
        return steps
