"""Futures of flight commands: whether a take-off, a flight or a landing is done, or why it failed.

    uav.take_off().wait()                # in the thread of a stopped simulation: advances it
    future = uav.go_to([5.0, 3.0, 2.0])
    simulation.run(3.0)
    print(future)                        # done, failed and why, or pending
    await uav.land()                     # in notebooks, alone or beside `simulation.run_async()`

The methods are those of `rclpy.task.Future`; `wait` and `await` are added.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any, Protocol

from volery.control.flight_modes import FlightMode
from volery.core.clock import s_from_ns
from volery.core.errors import CommandError, FlightError, WaitTimeoutError
from volery.core.uncopied import Uncopied


@dataclass(frozen=True)
class CommandResult:
    """State of a UAV when a flight command was done."""

    time_ns: int
    """Simulated time, ns."""
    position_map: tuple[float, float, float]
    """Position, m, in the map frame."""
    mode: FlightMode
    """Flight mode afterwards."""

    @property
    def time_s(self) -> float:
        """Simulated time, s."""
        return s_from_ns(self.time_ns)


class FlightSource(Protocol):
    """What a future needs of the simulation that flies the UAV."""

    def update(self, future: FlightFuture) -> None:
        """Settles the future if its command has ended."""

    def watch(self, future: FlightFuture) -> None:
        """Checks a future in each period, because code waits for its callbacks."""

    def describe(self, future: FlightFuture) -> str:
        """Returns mode and position of the UAV."""

    def wait(self, future: FlightFuture, timeout_s: float) -> bool:
        """Advances the simulation, or waits for it, until the future is done; returns if it is."""

    async def wait_async(self, future: FlightFuture) -> None:
        """Waits like `wait`, without a limit, and lets other coroutines run in between."""


class FlightFuture(Uncopied):
    """Completion of one flight command of one UAV, such as a take-off.

    It is done when the command has completed, and also when it has failed: the UAV crashed, was
    deleted, or another command replaced this one. `exception` has the reason.
    """

    def __init__(
        self,
        source: FlightSource,
        uav: str,
        command: str,
        active: tuple[FlightMode, ...],
        final: FlightMode,
    ) -> None:
        self.uav = uav
        """Name of the UAV; in a vectorized simulation `ENV/NAME`."""
        self.command = command
        """Name of the command, such as `take_off`."""
        self.active = active
        """Flight modes of the command."""
        self.final = final
        """Flight mode after the command."""
        self._source = source
        self._result: CommandResult | None = None
        self._error: FlightError | None = None
        self._callbacks: list[Callable[[FlightFuture], None]] = []

    def done(self) -> bool:
        """Returns whether the command has completed or failed."""
        if not self.is_settled:
            self._source.update(self)
        return self.is_settled

    def cancelled(self) -> bool:
        """Returns False: another command, such as `hold`, ends a flight command."""
        return False

    def result(self) -> CommandResult:
        """Returns the state at the end.

        Raises `FlightError` if the command failed, `CommandError` if it is not done yet.
        """
        if not self.done():
            raise CommandError(f"{self.pending_text()}; call wait(), or await it")
        if self._error is not None:
            raise self._error
        assert self._result is not None
        return self._result

    def exception(self) -> FlightError | None:
        """Returns why the command failed; None if it did not, or is not done."""
        self.done()
        return self._error

    def add_done_callback(self, callback: Callable[[FlightFuture], None]) -> None:
        """Calls `callback(future)` when it is done, at once if it is.

        The call comes from the thread that advances the UAV, within a tick: the callback may
        command UAVs, and does not wait.
        """
        if self.done():
            callback(self)
        else:
            self._callbacks.append(callback)
            self._source.watch(self)

    def wait(self, timeout_s: float = 60.0) -> CommandResult:
        """Waits until the command is done and returns the state then.

        In the thread of the simulation, and outside of a run, it advances the simulation as fast
        as possible; in another thread it waits for the run. `timeout_s` is simulated time, s;
        `math.inf` waits for as long as it takes. Raises `FlightError` if the command fails,
        `WaitTimeoutError` if it is not done in time, `CommandError` within a tick.
        """
        if not self.wait_until_done(timeout_s):
            raise self.timeout_error(timeout_s)
        return self.result()

    def wait_until_done(self, timeout_s: float) -> bool:
        """Waits like `wait`; returns whether the command is done."""
        return self.done() or self._source.wait(self, timeout_s)

    def timeout_error(self, timeout_s: float) -> WaitTimeoutError:
        """Returns the error of a wait of `timeout_s` that has ended before the command."""
        return WaitTimeoutError(
            f"{self.command} of {self.uav} is not done within {timeout_s:g} s; it goes on: "
            f"{self._source.describe(self)}"
        )

    def __await__(self) -> Generator[Any, None, CommandResult]:
        """Waits while other coroutines run, without a limit of time.

        Advances the simulation, unless `Simulation.run_async` or another thread does.
        """
        if not self.done():
            yield from self._source.wait_async(self).__await__()
        return self.result()

    def pending_text(self) -> str:
        """Returns that the command is not done, with mode and position of the UAV."""
        return f"{self.command} of {self.uav} is not done: {self._source.describe(self)}"

    # ------------------------------------------------------------------------- of the simulation

    @property
    def is_settled(self) -> bool:
        """Whether `complete` or `fail` was called."""
        return self._result is not None or self._error is not None

    def complete(self, result: CommandResult) -> None:
        """Sets the result and calls the callbacks."""
        if not self.is_settled:
            self._result = result
            self._call_back()

    def fail(self, time_s: float, reason: str) -> None:
        """Sets the failure and calls the callbacks."""
        if not self.is_settled:
            self._error = FlightError(
                f"{self.command} of {self.uav} failed at {time_s:.2f} s: {reason}"
            )
            self._call_back()

    def _call_back(self) -> None:
        callbacks, self._callbacks = self._callbacks, []
        for callback in callbacks:
            callback(self)

    def __repr__(self) -> str:
        name = f"{self.command} of {self.uav}"
        if self.done():
            text = f"{name} is done at {self._result.time_s:.2f} s" if self._result else self._error
        else:
            text = self.pending_text()
        return f"<FlightFuture: {text}>"
