"""Simulated time against wall time: paused, single steps, real time, any factor, or at full speed.

The thread that runs a simulation asks its `Pacer` how many steps to make and lets itself be held
back by it; any thread may pause it, let it go on or change its speed meanwhile. What a run computes
depends on none of that.
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
"""Steps between two looks at what other threads want, at full speed or one step after another."""
_LONGEST_WAIT_S = 0.05
_LATE_S = 0.05
_SLACK_S = 0.25
"""A run that falls behind by more does not rush afterwards to catch up."""


class Pacer:
    """How fast a simulation runs. What is not for "the thread that runs" may be called anywhere.

    Starts unpaused and at full speed.
    """

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._woken = False
        self._paused = False
        self._speed: float | None = None
        self._steps = StepQueue()  # single ones asked for and not made yet
        self._in_hand: StepRequest | None = None  # the one whose steps are being made
        self._reached_ns = 0
        self._wall_start = 0.0  # `_sim_start_ns` was, or is, due at this wall time
        self._sim_start_ns = 0
        self._paused_s = 0.0
        self._slice_s = _SLICE_S

    # ------------------------------------------------------------------------------- any thread

    @property
    def paused(self) -> bool:
        """Whether the run is held where it is."""
        return self._paused

    @property
    def speed(self) -> float | None:
        """Factor of real time, None for as fast as possible."""
        return self._speed

    @property
    def paused_s(self) -> float:
        """Wall seconds that runs have been paused in all."""
        return self._paused_s

    def pause(self) -> None:
        """Hold the run after the slice in progress; nothing where it is paused already."""
        with self._changed:
            self._paused = True
            self._changed.notify()

    def resume(self) -> None:
        """Go on at the speed from before the pause; what was missed is not caught up."""
        with self._changed:
            self._paused = False
            self._restart()
        self.drop_steps("the simulation goes on")

    def set_speed(self, speed: float | None) -> None:
        """Run at `speed` times real time from here on, None for as fast as possible."""
        if speed is not None and not 0.0 < speed < 1e6:
            raise CommandError(f"speed must be a positive factor of real time, not {speed}")
        with self._changed:
            if speed != self._speed:
                self._speed = speed
                self._restart()

    def single_steps(self, steps: int, on_steps: OnSteps | None = None) -> StepRequest:
        """Let a paused run make that many physics steps more and wait again.

        on_steps: told of each piece that is made and of the end, which may come early.
        """
        if steps < 1:
            raise CommandError(f"a single step is at least 1 step, not {steps}")
        request = StepRequest(steps, on_steps)
        with self._changed:
            if not self._paused:
                raise CommandError("single steps are made while paused; call pause() first")
            self._steps.add(request)
            self._changed.notify()
        return request

    def drop_steps(self, reason: str, only: StepRequest | None = None) -> None:
        """Make no more of the single steps asked for, or of `only` one request."""
        with self._changed:
            dropped = self._steps.drop(reason, only)
        for request in dropped:
            request.tell()

    def use_low_latency(self) -> None:
        """Make slices of `_PROMPT_SLICE_S`: what is commanded acts that soon in wall time."""
        self._slice_s = _PROMPT_SLICE_S

    def wake(self) -> None:
        """End the present `wait`: there is something to do for the thread that runs."""
        with self._changed:
            self._woken = True
            self._changed.notify()

    # ------------------------------------------------------------------- the thread that runs

    def begin(self, speed: float | None, time_ns: int) -> None:
        """Start a run at simulated `time_ns`; a pause stays one."""
        self.set_speed(speed)
        with self._changed:
            self._reached_ns = time_ns
            self._restart()

    def jumped(self, time_ns: int) -> None:
        """Go on from simulated `time_ns`, where another state was restored, at the same speed."""
        with self._changed:
            self._reached_ns = time_ns
            self._restart()

    def next_steps(self, dt_ns: int) -> int:
        """Physics steps of `dt_ns` to make before the next `wait`; 0 while paused."""
        with self._changed:
            if self._paused:
                self._in_hand = self._steps.first
                return 0 if self._in_hand is None else min(self._in_hand.left, _FULL_SPEED_SLICE)
            if self._speed is None:
                return _FULL_SPEED_SLICE
            return max(1, round(self._slice_s * self._speed * NS_PER_S) // dt_ns)

    def made(self, steps: int) -> None:
        """Note that the steps of `next_steps` were made, or some of them."""
        with self._changed:
            request, self._in_hand = self._in_hand, None
            told = request is not None and self._steps.count(request, steps)
        if request is not None and told:
            request.tell()

    def wait(self, time_ns: int) -> bool:
        """Hold the run at simulated `time_ns`, at most a moment; whether it must be held further.

        The moments let the caller tell its progress, do what was posted, and a user stop.
        """
        with self._changed:
            self._reached_ns = time_ns
            if not self._woken:
                self._wait_a_moment()
            self._woken = False
            return self._must_wait()

    def idle_s(self) -> float:
        """Wall seconds to spare before the run must go on, at most a moment."""
        with self._changed:
            if self._paused:
                return 0.0 if self._steps else _LONGEST_WAIT_S
            if self._speed is None:
                return 0.0
            return min(max(self._ahead_s(self._speed), 0.0), _LONGEST_WAIT_S)

    @property
    def is_behind(self) -> bool:
        """Whether the run has no time to spare: it is late, or runs as fast as it can."""
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
        """Wall seconds until the simulated time that has been reached is due."""
        due = self._wall_start + (self._reached_ns - self._sim_start_ns) / NS_PER_S / speed
        return due - time.perf_counter()

    def _restart(self) -> None:
        """Count due times from here and now."""
        self._wall_start = time.perf_counter()
        self._sim_start_ns = self._reached_ns
        self._changed.notify()
