"""Provides lock-step partners: external programs that the simulation waits for.

The engine stops at each instant of a partner's period (barrier) until the partner has replied, and
applies the reply before the next physics step. So a run with partners is as reproducible as they
are. A partner that exceeds its timeout ends the run with an error or, if so agreed, is dropped. A
partner cannot be restored to an earlier state; a partner that restarts by itself allows the
simulation to be reset.

    partner = simulation.clock.add_partner("control_state", period_s=0.02, timeout_s=5.0)

    # in the partner's thread
    while (time_ns := partner.wait()) is not None:
        partner.reply(lambda: uav.command_velocity([1.0, 0.0, 0.0]))
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Literal, Protocol

from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError, PartnerError

Action = Callable[[], Any]

_LOOK_S = 0.1
"""Wall time between two checks whether a partner is still connected."""
_SPARE_S = 0.01
"""Wall time for clients' commands between two checks whether a partner has replied."""


class Partner:
    """One partner; `wait`, `reply` and `leave` are called in its own thread."""

    def __init__(
        self,
        name: str,
        timeout_s: float,
        on_timeout: Literal["stop", "leave"],
        *,
        on_meeting: Callable[[int], None] | None = None,
        is_there: Callable[[], bool] | None = None,
        supports_reset: bool = False,
        meets_at_start: bool = False,
        period_s: float = 0.0,
    ) -> None:
        """Creates a partner with the terms of `add_partner`.

        `on_meeting(time_ns)` notifies the partner of a barrier, in the engine's thread;
        `is_there()` returns whether the partner can still reply.
        """
        self.name = name
        self.timeout_s = timeout_s
        self.period_s = period_s
        self.supports_reset = supports_reset
        self.meets_at_start = meets_at_start
        self._on_timeout = on_timeout
        self._on_meeting = on_meeting
        self._is_there = is_there
        self._wake: Callable[[], None] = _nothing
        self._changed = threading.Condition()
        self._barrier_ns: int | None = None
        self._actions: tuple[Action, ...] | None = None
        self._left = False

    @property
    def has_left(self) -> bool:
        """Whether the engine no longer waits for the partner."""
        return self._left

    # ------------------------------------------------------------------------ the partner's thread

    def wait(self, timeout_s: float | None = None) -> int | None:
        """Waits for the next barrier; returns its simulated time, ns, or None after the last one.

        Raises `PartnerError` if no barrier begins within `timeout_s` of wall time.
        """
        with self._changed:
            came = self._changed.wait_for(
                lambda: self._left or (self._barrier_ns is not None and self._actions is None),
                timeout_s,
            )
            if not came:
                raise PartnerError(f"{self.name}: no barrier within {timeout_s} s of wall time")
            return None if self._left else self._barrier_ns

    def reply(self, *actions: Action) -> None:
        """Ends the barrier, after the engine has called `actions` in its own thread, in order."""
        with self._changed:
            if self._left:
                return
            if self._barrier_ns is None or self._actions is not None:
                raise PartnerError(f"{self.name}: no barrier to reply to; call wait() first")
            self._actions = actions
            self._changed.notify_all()
        self._wake()

    def leave(self) -> None:
        """Leaves: the engine no longer waits for the partner."""
        with self._changed:
            self._left = True
            self._changed.notify_all()
        self._wake()

    # ------------------------------------------------------------------------- the engine's thread

    def call(self, time_ns: int, wake: Callable[[], None]) -> None:
        """Begins the barrier at `time_ns`; `wake` is called at its end."""
        with self._changed:
            self._wake = wake
            self._barrier_ns, self._actions = time_ns, None
            self._changed.notify_all()
        if self._on_meeting is not None:
            self._on_meeting(time_ns)

    @property
    def answered(self) -> bool:
        """Whether the partner has replied or left."""
        if self._is_there is not None and not self._is_there():
            self._left = True
        return self._left or self._actions is not None

    def collect(self) -> tuple[Action, ...]:
        """Ends the barrier; returns the reply's actions, none from a partner that has left.

        Raises `PartnerError` if the partner has not replied, unless it agreed to be dropped.
        """
        with self._changed:
            came = self.answered
            barrier_ns, self._barrier_ns = self._barrier_ns, None
            actions, self._actions = self._actions or (), None
            if came:
                return actions
            self._left = True
            self._changed.notify_all()
        if self._on_timeout == "leave" or barrier_ns is None:
            return ()
        raise PartnerError(
            f"partner '{self.name}' did not answer within {self.timeout_s} s of wall time at "
            f"{barrier_ns / 1e9:.3f} s"
        )


def check_terms(period_s: float, timeout_s: float, on_timeout: str, dt_ns: int) -> None:
    """Raises `CommandError` for invalid terms, with physics steps of `dt_ns`."""
    for value, what in ((period_s, "period_s"), (timeout_s, "timeout_s")):
        if not (math.isfinite(value) and value > 0.0):
            raise CommandError(f"{what} must be finite and positive, not {value}")
    if period_s * NS_PER_S < dt_ns:
        raise CommandError(f"period_s = {period_s} is less than a physics step of {dt_ns / 1e9} s")
    if on_timeout not in ("stop", "leave"):
        raise CommandError(f'on_timeout must be "stop" or "leave", not {on_timeout!r}')


class PartnerBarrier(Protocol):
    """The engine during a barrier: executes posted commands, including the partners' own."""

    def process_commands(self, idle_s: float) -> None:
        """Executes posted commands; `idle_s` of wall time are to spare for them."""

    def wait(self, timeout_s: float) -> None:
        """Waits for a command or a wake."""

    def goes_on(self) -> bool:
        """Returns whether the run continues; called repeatedly during the barrier."""

    def wake(self) -> None:
        """Ends the wait; callable from any thread."""


def meet(partners: Sequence[Partner], time_ns: int, engine: PartnerBarrier) -> bool:
    """Waits for all `partners`; applies their replies in the given order.

    Returns False if the run ends before all have replied.
    """
    start = time.monotonic()
    waited_for = [partner for partner in partners if not partner.has_left]
    for partner in waited_for:
        partner.call(time_ns, engine.wake)
    for partner in waited_for:
        while not partner.answered:
            left_s = start + partner.timeout_s - time.monotonic()
            if left_s <= 0.0:
                break
            engine.wait(min(left_s, _LOOK_S))
            engine.process_commands(_SPARE_S)
            if not engine.goes_on():
                return False
    for partner in waited_for:
        for action in partner.collect():
            action()
    return True


def _nothing() -> None:
    """Does nothing."""
