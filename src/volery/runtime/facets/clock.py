"""The clock of a simulation: pauses, single steps, real-time factor, lock-step partners."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, Protocol

from volery.core.clock import s_from_ns
from volery.core.errors import CommandError
from volery.engine.engine import Engine
from volery.engine.lock_step import Partner, check_terms
from volery.engine.pacing import Pacer
from volery.engine.single_steps import OnSteps, StepRequest
from volery.runtime.run_loop import RunLoop


class RunClock(Protocol):
    """Controls a run: of a simulation, or the playback of a log."""

    @property
    def paused(self) -> bool:
        """Whether the run is paused, or will be at its start."""

    @property
    def speed(self) -> float | None:
        """Real-time factor; None: as fast as possible."""

    def pause(self) -> None:
        """Pauses the run until `resume`."""

    def resume(self) -> None:
        """Resumes the run."""

    def set_speed(self, speed: float | None) -> None:
        """Sets the real-time factor; None: as fast as possible."""

    def single_step(self, steps: int = 1) -> object:
        """Runs physics steps of a paused run. Raises `CommandError` if it is not paused."""


class SimulationClock:
    """Controls the runs of a simulation.

    Any thread may use its members, except `add_partner`. partners: list of the lock-step partners,
    which it shares with others. check_open: raises `CommandError` once the simulation is closed.
    """

    def __init__(
        self,
        engine: Engine,
        pacer: Pacer,
        loop: RunLoop,
        partners: list[Partner],
        check_open: Callable[[], None],
    ) -> None:
        self._engine = engine
        self._pacer = pacer
        self._loop = loop
        self._partners = partners
        self._check_open = check_open

    def __repr__(self) -> str:
        speed = "as fast as possible" if self.speed is None else f"{self.speed:g} times real time"
        state = "paused" if self.paused else speed
        return f"<clock: {s_from_ns(self._engine.time_ns):.3f} s, {state}>"

    @property
    def finished(self) -> bool:
        """Whether the run has ended: the duration is over, all UAVs have landed, or `quit`."""
        return self._loop.finished

    @property
    def paused(self) -> bool:
        """Whether the run is paused, or will be at its start."""
        return self._pacer.paused

    @property
    def paused_s(self) -> float:
        """Wall seconds of all pauses."""
        return self._pacer.paused_s

    @property
    def speed(self) -> float | None:
        """Real-time factor of the present or last run; None: as fast as possible."""
        return self._pacer.speed

    def pause(self) -> None:
        """Pauses the run between two ticks, and later runs at their start, until `resume`.

        Posted actions still run; results do not depend on pauses.
        """
        self._pacer.pause()

    def resume(self) -> None:
        """Resumes a paused run; the pause is not made up for."""
        self._pacer.resume()

    def set_speed(self, speed: float | None) -> None:
        """Sets the present run's real-time factor; None: as fast as possible."""
        self._pacer.set_speed(speed)

    def single_step(self, steps: int = 1, on_steps: OnSteps | None = None) -> StepRequest:
        """Runs physics steps of a paused run. Raises `CommandError` if it is not paused.

        Returns at once: the thread of the run makes the steps and calls `on_steps`. Without a
        running thread use `Simulation.step`.
        """
        return self._pacer.single_steps(steps, on_steps)

    def cancel_steps(self, request: StepRequest) -> None:
        """Cancels the rest of a `single_step`."""
        self._pacer.drop_steps("cancelled", request)

    def quit(self) -> None:
        """Ends the present run as soon as possible, and later runs at their start."""
        self._loop.quit()

    @property
    def quitting(self) -> bool:
        """Whether `quit` was called."""
        return self._loop.quitting

    def add_partner(
        self,
        name: str,
        *,
        period_s: float,
        timeout_s: float = 10.0,
        on_timeout: Literal["stop", "leave"] = "stop",
        on_meeting: Callable[[int], None] | None = None,
        is_there: Callable[[], bool] | None = None,
        supports_reset: bool = False,
        meets_at_start: bool = False,
    ) -> Partner:
        """Waits for an external program each `period_s` of simulated time; see `engine.lock_step`.

        timeout_s: wall time after which a silent partner ends the run with `PartnerError`
        (`on_timeout` "stop"), or is waited for no more. on_meeting: called with the time, ns, when
        a barrier begins. is_there: returns whether the partner can still respond; otherwise it is
        waited for no more. supports_reset: the partner restarts when the time of a barrier is
        earlier than that of the last one, so that `reset` is possible. meets_at_start: the first
        barrier is at time 0, before the first step. Raises `CommandError`.
        """
        self._check_open()
        check_terms(period_s, timeout_s, on_timeout, self._engine.fleet.dt_ns)
        if any(partner.name == name and not partner.has_left for partner in self._partners):
            raise CommandError(f"there is a lock-step partner '{name}' already")
        partner = Partner(
            name,
            timeout_s,
            on_timeout,
            on_meeting=on_meeting,
            is_there=is_there,
            supports_reset=supports_reset,
            meets_at_start=meets_at_start,
            period_s=period_s,
        )
        self._partners.append(partner)
        self._engine.wait_for(partner, period_s)
        return partner
