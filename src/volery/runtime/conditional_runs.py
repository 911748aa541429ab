"""Advances a simulation until something happens: a condition, an event, flight commands."""

from __future__ import annotations

import asyncio
import math
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from textwrap import shorten
from typing import Any, TypeAlias

from volery.core.clock import NS_PER_S, s_from_ns
from volery.core.errors import CommandError, WaitTimeoutError
from volery.engine.engine import Engine
from volery.engine.events import Event, EventKind
from volery.runtime.checks import check_timeout
from volery.runtime.run_loop import RunLoop
from volery.runtime.vehicles.flight_future import FlightFuture

DEFAULT_TIMEOUT_S = 60.0
CHECK_PERIOD_S = 0.01
"""Period of simulated time after which a condition in Python is checked."""
_POLL_PERIOD_S = 0.02
"""Wall time between two checks of a run in another thread, s ..."""
_MAX_IDLE_S = 2.0
"""... which may spend this long, s, between two calls of `run`."""

Awaited: TypeAlias = "Callable[[], bool] | FlightFuture | Iterable[FlightFuture] | EventKind | str"
"""What a run can wait for."""


class _AtEachTick:
    """A condition that changes with events and samples, which end ticks."""

    def __init__(self, is_true: Callable[[], bool]) -> None:
        self._is_true = is_true

    def __call__(self) -> bool:
        return self._is_true()

    def next_check(self, step: int) -> int:  # noqa: ARG002 - a tick ends by itself
        return sys.maxsize


class _AtEachPeriod:
    """A condition of the user, checked once at each multiple of a period since time 0.

    So the end of the run does not depend on how it is divided into calls.
    """

    def __init__(self, is_true: Callable[[], bool], engine: Engine, period_s: float) -> None:
        self._is_true = is_true
        self._engine = engine
        self._steps = max(1, round(period_s * NS_PER_S / engine.dt_ns))
        self._checked = -1
        self._result = False

    def __call__(self) -> bool:
        step = self._engine.fleet.step
        is_due = self._checked < 0 or step % self._steps == 0
        if is_due and step != self._checked and not self._result:
            self._checked = step
            self._result = bool(self._is_true())
        return self._result

    def next_check(self, step: int) -> int:
        return step + self._steps - step % self._steps


class ConditionalRuns:
    """Runs of one simulation that end when a condition becomes true.

    events: list of all events, which grows. look: called between two pieces of a run.
    """

    def __init__(
        self,
        engine: Engine,
        loop: RunLoop,
        events: list[Event],
        look: Callable[[], None],
        check_open: Callable[[], None],
    ) -> None:
        self._engine = engine
        self._loop = loop
        self._events = events
        self._look = look
        self._check_open = check_open

    @property
    def time_s(self) -> float:
        """Simulated time, s."""
        return s_from_ns(self._engine.time_ns)

    def run_until(
        self, awaited: Awaited, timeout_s: float, speed: float | None, check_period_s: float
    ) -> Event | None:
        """Advances until what is awaited has happened; see `Simulation.run_until`."""
        goal = _Goal(awaited, self._engine, self._events, check_period_s)
        self._check_possible()
        with self._loop.occupied():
            for _ in self._pieces(goal, timeout_s, speed):
                pass
        return goal.result(self, timeout_s)

    async def run_until_async(
        self, awaited: Awaited, timeout_s: float, speed: float | None, check_period_s: float
    ) -> Event | None:
        """Does the same, and lets other coroutines run in between."""
        goal = _Goal(awaited, self._engine, self._events, check_period_s)
        self._check_possible()
        await self.drive(self._pieces(goal, timeout_s, speed))
        return goal.result(self, timeout_s)

    async def drive(self, pieces: Iterator[None]) -> None:
        """Runs pieces one after the other, and lets other coroutines run in between."""
        self._check_possible()
        with self._loop.occupied():
            for _ in pieces:
                await asyncio.sleep(0)

    def advance(self, condition: Callable[[], bool], seconds: float | None) -> bool:
        """Advances until `condition()` after a tick, or by `seconds`; returns the condition.

        Without `seconds`, the run ends at the scenario's end.
        """
        self._check_possible()
        left = self._loop.remaining_s if seconds is None else seconds
        is_over = condition if seconds is not None else lambda: condition() or self._loop.finished
        with self._loop.occupied():
            for _ in self._loop.pieces_until(_AtEachTick(is_over), left, None, self._look):
                pass
        return condition()

    def wait(self, is_done: Callable[[], bool], timeout_s: float) -> bool:
        """Waits for `is_done()`: advances the simulation, or waits for the thread that does.

        Returns whether it became true within `timeout_s` of simulated time. Raises `CommandError`
        if the simulation is quit or does not advance.
        """
        check_timeout(timeout_s)
        if self._is_own():
            is_over = self.advance(is_done, timeout_s)
        else:
            is_over = self._wait_for_thread(is_done, timeout_s)
        if not is_over and self._loop.quitting:
            raise CommandError(self._quit_text())
        return is_over

    async def wait_async(self, is_done: Callable[[], bool]) -> None:
        """Waits for `is_done()` like `wait`, and lets other coroutines run in between."""
        await asyncio.sleep(0)  # a task that has just been created may advance the simulation
        idle_s = 0.0
        while not is_done():
            if self._loop.quitting:
                raise CommandError(self._quit_text())
            if self._loop.thread == threading.get_ident():  # another coroutine advances it
                await asyncio.sleep(0)
            elif self._loop.thread is None and self._is_own():
                pieces = self._loop.pieces_until(_AtEachTick(is_done), math.inf, None, self._look)
                await self.drive(pieces)
            else:
                idle_s = self._check_idle(idle_s)
                await asyncio.sleep(_POLL_PERIOD_S)

    def is_busy(self) -> bool:
        """Returns whether another thread advances the simulation now."""
        return self._loop.thread not in (None, threading.get_ident())

    def _is_own(self) -> bool:
        """Returns whether this thread advances the simulation; a thread that ended leaves it."""
        owner = self._loop.owner
        own = owner == threading.get_ident()
        return own or all(thread.ident != owner for thread in threading.enumerate())

    def _check_idle(self, idle_s: float) -> float:
        """Returns for how long the other thread is idle; raises `CommandError` if too long."""
        idle_s = 0.0 if self._loop.thread is not None else idle_s + _POLL_PERIOD_S
        if idle_s > _MAX_IDLE_S:
            raise CommandError("the simulation does not advance: its own thread must call run()")
        return idle_s

    def _quit_text(self) -> str:
        return f"the run was quit at {self.time_s:.2f} s"

    def _wait_for_thread(self, is_done: Callable[[], bool], timeout_s: float) -> bool:
        end_s, idle_s = self.time_s + timeout_s, 0.0
        while not is_done() and self.time_s < end_s and not self._loop.quitting:
            time.sleep(_POLL_PERIOD_S)
            idle_s = self._check_idle(idle_s)
        return is_done()

    def _pieces(self, goal: _Goal, timeout_s: float, speed: float | None) -> Iterator[None]:
        check_timeout(timeout_s)
        return self._loop.pieces_until(goal.condition, timeout_s, speed, self._look)

    def _check_possible(self) -> None:
        self._check_open()
        if self._loop.thread is not None or not self._engine.stands:
            raise CommandError(
                "the simulation is advancing already, so it cannot be advanced from here: use "
                "add_done_callback(), or `await` beside run_async()"
            )


class _Goal:
    """What a run waits for, as a condition, and the result for the caller."""

    def __init__(
        self, awaited: Awaited, engine: Engine, events: list[Event], check_period_s: float
    ) -> None:
        self._futures: tuple[FlightFuture, ...] = ()
        self._events = events
        self._first = len(events)
        self._kind: EventKind | None = None
        self.condition: Any = _AtEachTick(self._happened)
        if isinstance(awaited, FlightFuture):
            self._futures = (awaited,)
        elif isinstance(awaited, str):
            self._kind = _kind_of(awaited)
        elif callable(awaited):
            _check_period(check_period_s)
            self.condition = _AtEachPeriod(awaited, engine, check_period_s)
        else:
            self._futures = _futures_of(awaited)
        self._name = f"event '{self._kind}'" if self._kind else _name_of(awaited)

    def result(self, runs: ConditionalRuns, timeout_s: float) -> Event | None:
        """Returns the event; raises the failure of a command, or `WaitTimeoutError`."""
        for future in self._futures:
            if future.done():
                future.result()
        if not self.condition():
            pending = [future for future in self._futures if not future.done()]
            if runs._loop.quitting:
                raise CommandError(runs._quit_text())
            if pending:
                raise pending[0].timeout_error(timeout_s)
            raise WaitTimeoutError(
                f"{self._name} did not happen within {timeout_s:g} s, at {runs.time_s:.2f} s; "
                "pass a longer timeout_s?"
            )
        return self._found()

    def _happened(self) -> bool:
        if self._kind is not None:
            return self._found() is not None
        return all(future.done() for future in self._futures) or any(
            future.done() and future.exception() is not None for future in self._futures
        )

    def _found(self) -> Event | None:
        new = self._events[self._first :]
        return next((event for event in new if event.kind is self._kind), None)


def _kind_of(name: str) -> EventKind:
    try:
        return EventKind(name)
    except ValueError:
        known = ", ".join(EventKind)
        raise CommandError(f"there is no event '{name}'; known: {known}") from None


def _futures_of(awaited: Any) -> tuple[FlightFuture, ...]:
    try:
        futures = tuple(awaited.values() if isinstance(awaited, Mapping) else awaited)
    except TypeError:
        futures = (awaited,)
    if not all(isinstance(future, FlightFuture) for future in futures):
        raise CommandError(
            "run_until takes a function without arguments, an EventKind or its name, or what "
            f"take_off(), go_to(), ... return, not {shorten(repr(awaited), 60, placeholder=' ...')}"
        )
    if not futures:
        raise CommandError(
            "there is nothing to wait for: no flight command is among what run_until was given; "
            "uav.wait() and simulation.vehicles.wait() wait for the present commands"
        )
    return futures


def _name_of(awaited: Any) -> str:
    name = getattr(awaited, "__name__", type(awaited).__name__)
    return "the condition" if name == "<lambda>" else f"the condition {name}()"


def _check_period(period_s: Any) -> None:
    if not isinstance(period_s, int | float) or not 0.0 < period_s < math.inf:
        raise CommandError(f"check_period_s must be above 0 and finite, not {period_s!r}")
