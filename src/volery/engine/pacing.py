"""Controls simulated time relative to wall time: pause, single steps, real-time factor.

The thread that runs a simulation gets the number of steps from its `Pacer` and waits in it; any
thread may pause, resume or change the real-time factor meanwhile. The results of a run do not
depend on the pacing.
"""

from __future__ import annotations

import threading
import time

from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError
from volery.engine.single_steps import OnSteps, StepQueue, StepRequest

_SLICE_S = 0.005
_PROMPT_SLICE_S = 0.001
_FULL_SPEED_SLICE = 100
"""Steps between two checks for other threads' commands, at full speed or in single steps."""
_LONGEST_WAIT_S = 0.05
_LATE_S = 0.05
_SLACK_S = 0.25
"""A run that is late by more does not catch up afterwards."""


class Pacer:
    """Pace of a simulation. Methods not under "the thread that runs" are thread-safe.

    Starts unpaused and at full speed.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._woken = False
        self._paused = False
        self._speed: float | None = None
        self._steps = StepQueue()  # requested single steps that are pending
        self._in_hand: StepRequest | None = None  # the request whose steps are being run
        self._reached_ns = 0
        self._wall_start = 0.0  # `_sim_start_ns` was, or is, due at this wall time
        self._sim_start_ns = 0
        self._paused_s = 0.0
        self._slice_s = _SLICE_S

    # ------------------------------------------------------------------------------- any thread

    @property
    def paused(self) -> bool:
        """Whether the run is paused."""
        return self._paused

    @property
    def speed(self) -> float | None:
        """Real-time factor, None for as fast as possible."""
        return self._speed

    @property
    def paused_s(self) -> float:
        """Total wall time of all pauses, s."""
        return self._paused_s

    def pause(self) -> None:
        """Pauses the run after the current slice; has no effect when paused."""
        with self._changed:
            self._paused = True
            self._changed.notify()

    def resume(self) -> None:
        """Resumes at the previous real-time factor; the missed time is not caught up."""
        with self._changed:
            self._paused = False
            self._restart()
        self.drop_steps("the simulation continues")

    def set_speed(self, speed: float | None) -> None:
        """Sets the real-time factor from now on, None for as fast as possible."""
        if speed is not None and not 0.0 < speed < 1e6:
            raise CommandError(f"speed must be a positive real-time factor, not {speed}")
        with self._changed:
            if speed != self._speed:
                self._speed = speed
                self._restart()

    def single_steps(self, steps: int, on_steps: OnSteps | None = None) -> StepRequest:
        """Runs that many physics steps of a paused run, then waits again.

        on_steps: called after each part of the steps and at the end, which may come early.
        """
        if steps < 1:
            raise CommandError(f"steps must be at least 1, not {steps}")
        request = StepRequest(steps, on_steps)
        with self._changed:
            if not self._paused:
                raise CommandError("single steps need a paused run; call pause() first")
            self._steps.add(request)
            self._changed.notify()
        return request

    def drop_steps(self, reason: str, only: StepRequest | None = None) -> None:
        """Drops all pending single steps, or those of `only` one request."""
        with self._changed:
            dropped = self._steps.drop(reason, only)
        for request in dropped:
            request.notify()

    def use_low_latency(self) -> None:
        """Reduces slices to `_PROMPT_SLICE_S`, which limits the wall time until commands act."""
        self._slice_s = _PROMPT_SLICE_S

    def wake(self) -> None:
        """Ends the current `wait`, because the running thread has work to do."""
        with self._changed:
            self._woken = True
            self._changed.notify()

    # ------------------------------------------------------------------- the thread that runs

    def begin(self, speed: float | None, time_ns: int) -> None:
        """Starts a run at simulated `time_ns`; a paused run stays paused."""
        self.set_speed(speed)
        with self._changed:
            self._reached_ns = time_ns
            self._restart()

    def jumped(self, time_ns: int) -> None:
        """Continues from simulated `time_ns` of a restored state, at the same real-time factor."""
        with self._changed:
            self._reached_ns = time_ns
            self._restart()

    def next_steps(self, dt_ns: int) -> int:
        """Returns the physics steps of `dt_ns` to run before the next `wait`; 0 while paused."""
        with self._changed:
            if self._paused:
                self._in_hand = self._steps.first
                return 0 if self._in_hand is None else min(self._in_hand.left, _FULL_SPEED_SLICE)
            if self._speed is None:
                return _FULL_SPEED_SLICE
            return max(1, round(self._slice_s * self._speed * NS_PER_S) // dt_ns)

    def made(self, steps: int) -> None:
        """Records that all or some steps of `next_steps` were run."""
        with self._changed:
            request, self._in_hand = self._in_hand, None
            is_counted = request is not None and self._steps.count(request, steps)
        if request is not None and is_counted:
            request.notify()

    def wait(self, time_ns: int) -> bool:
        """Waits at simulated `time_ns`, at most a moment; returns whether to wait further.

        In between, the caller reports progress, executes commands, and lets a user stop.
        """
        with self._changed:
            self._reached_ns = time_ns
            if not self._woken:
                self._wait_a_moment()
            self._woken = False
            return self._must_wait()

    def idle_s(self) -> float:
        """Returns the wall time to spare before the run must continue, s, at most a moment."""
        with self._changed:
            if self._paused:
                return 0.0 if self._steps else _LONGEST_WAIT_S
            if self._speed is None:
                return 0.0
            return min(max(self._ahead_s(self._speed), 0.0), _LONGEST_WAIT_S)

    @property
    def is_behind(self) -> bool:
        """Whether the run has no time to spare: late, or as fast as possible."""
        with self._changed:
            if self._paused:
                return False
            return self._speed is None or self._ahead_s(self._speed) < -_LATE_S

    def _must_wait(self) -> bool:
        if self._paused:
            return not self._steps
        return self._speed is not None and self._ahead_s(self._speed) > 0.0

    def _wait_a_moment(self) -> None:
        if self._paused:
            if not self._steps:
                before = time.perf_counter()
                self._changed.wait(_LONGEST_WAIT_S)
                self._paused_s += time.perf_counter() - before
        elif self._speed is not None:
            ahead = self._ahead_s(self._speed)
            if ahead > 0.0:
                self._changed.wait(min(ahead, _LONGEST_WAIT_S))
            elif ahead < -_SLACK_S:
                self._wall_start -= ahead + _SLACK_S

    def _ahead_s(self, speed: float) -> float:
        """Returns the wall time until the simulated time reached so far is due, s."""
        due = self._wall_start + (self._reached_ns - self._sim_start_ns) / NS_PER_S / speed
        return due - time.perf_counter()

    def _restart(self) -> None:
        """Computes due times from the current instant on."""
        self._wall_start = time.perf_counter()
        self._sim_start_ns = self._reached_ns
        self._changed.notify()
