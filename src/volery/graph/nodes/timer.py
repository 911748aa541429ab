"""Provides timers like rclpy's, which can be cancelled, restarted and destroyed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from volery.core.clock import NS_PER_S, ns_from_s
from volery.graph.graph import check_period
from volery.graph.nodes.deferred_execution import Deferred


class Timers(Deferred, Protocol):
    """Calls functions at simulated times."""

    def every(
        self,
        period_s: float,
        callback: Callable[[], None],
        *,
        wanted: Callable[[], bool] | None = None,
    ) -> None:
        """Calls `callback` every period, from one period on; not while `wanted()` is false."""

    def forget(self, callback: Callable[[], None]) -> None:
        """Stops calling a `callback` that was passed to `every`."""


class Timer:
    """Calls a function every period of the node's time; created by `Node.create_timer`.

    `cancel` stops the timer, `reset` restarts its period.
    """

    def __init__(
        self,
        period_s: float,
        callback: Callable[[], Any],
        ring: Callable[[], None],
        timers: Timers,
        now_ns: Callable[[], int],
        defer: Callable[[Callable[[], Any]], Any],
        *,
        autostart: bool = True,
        clock: Any = None,
    ) -> None:
        """Creates the timer; `ring()` runs the callback; `defer` delays changes to the release."""
        self.callback = callback
        self.clock = clock
        """Clock of the node."""
        self._ring = ring
        self._timers = timers
        self._now_ns = now_ns
        self._defer = defer
        self._period_ns = ns_from_s(period_s)
        self._cancelled = not autostart
        self._destroyed = False
        self._due_ns: int | None = None
        """After a restart: time of the next call; None: the timer still has its first phase."""
        self._is_armed = False
        """Whether the next call after a restart is scheduled."""
        self._started_ns = self._last_ns = now_ns()
        timers.every(period_s, self._on_period, wanted=self._has_initial_phase)

    # -------------------------------------------------------------------------------------- rclpy's

    @property
    def timer_period_ns(self) -> int:
        """Period, ns; another one counts from the present time."""
        return self._period_ns

    @timer_period_ns.setter
    def timer_period_ns(self, period_ns: int) -> None:
        check_period(period_ns / NS_PER_S)

        def change() -> None:
            self._period_ns = int(period_ns)
            if not self._cancelled:
                self._restart()

        self._defer(change)

    def cancel(self) -> None:
        """Stops the timer until `reset`."""
        self._defer(lambda: self._set_cancelled(now=True))

    def is_canceled(self) -> bool:
        """Returns whether the timer is cancelled."""
        return self._cancelled

    def reset(self) -> None:
        """Restarts the period, also after `cancel`: the next call comes one period from now."""
        self._defer(self._restart)

    def is_ready(self) -> bool:
        """Returns whether the next call is due."""
        return not self._cancelled and self.time_until_next_call() <= 0

    def time_since_last_call(self) -> int:
        """Returns the time since the last call or the start, ns."""
        return self._now_ns() - self._last_ns

    def time_until_next_call(self) -> int:
        """Returns the time until the next call, ns."""
        now_ns = self._now_ns()
        if self._due_ns is not None:
            return self._due_ns - now_ns
        return self._period_ns - (now_ns - self._started_ns) % self._period_ns

    def destroy(self) -> None:
        """Destroys the timer."""
        self._destroyed = True
        self._timers.forget(self._on_period)

    # ------------------------------------------------------------------------------------ internal

    def _has_initial_phase(self) -> bool:
        return self._due_ns is None and not self._cancelled and not self._destroyed

    def _set_cancelled(self, *, now: bool) -> None:
        self._cancelled = now

    def _on_period(self) -> None:
        self._last_ns = self._now_ns()
        self._ring()

    def _restart(self) -> None:
        if self._destroyed:
            return
        self._cancelled = False
        self._last_ns = self._now_ns()
        self._due_ns = self._last_ns + self._period_ns
        self._arm()

    def _arm(self) -> None:
        if not self._is_armed and self._due_ns is not None:
            self._is_armed = True
            self._timers.at(self._due_ns, self._on_due)

    def _on_due(self) -> None:
        self._is_armed = False
        if self._due_ns is None or self._cancelled or self._destroyed:
            return
        if self._now_ns() >= self._due_ns:  # else the timer was restarted meanwhile
            self._due_ns += self._period_ns
            self._arm()
            self._on_period()
        else:
            self._arm()

    def get_state(self) -> Any:
        """Returns the state for a snapshot."""
        return self._cancelled, self._due_ns, self._is_armed, self._last_ns, self._period_ns

    def set_state(self, state: Any) -> None:
        """Restores a saved state."""
        self._cancelled, self._due_ns, self._is_armed, self._last_ns, self._period_ns = state
