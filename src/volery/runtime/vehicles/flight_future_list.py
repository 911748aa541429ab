"""Futures of a command to several UAVs, waited for as that of one."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from typing import Any

from volery.runtime.vehicles.flight_future import CommandResult, FlightFuture


class FlightFutureList(list[FlightFuture]):
    """Futures of one command to several UAVs: `vehicles.take_off().wait()`, or `await` it.

    now_s: returns the simulated time, s.
    """

    def __init__(self, futures: Iterable[FlightFuture], now_s: Callable[[], float]) -> None:
        super().__init__(futures)
        self._now_s = now_s

    def wait(self, timeout_s: float = 60.0) -> list[CommandResult]:
        """Waits for all of them, `timeout_s` of simulated time, s, together.

        Returns their results. See `FlightFuture.wait`.
        """
        end_s = self._now_s() + timeout_s
        for future in self:
            if not future.wait_until_done(max(0.0, end_s - self._now_s())):
                raise future.timeout_error(timeout_s)
        return [future.result() for future in self]

    def __await__(self) -> Generator[Any, None, list[CommandResult]]:
        """Waits for all of them while other coroutines run; see `FlightFuture`."""
        results = []
        for future in self:
            results.append((yield from future.__await__()))
        return results
