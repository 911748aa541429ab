"""Plays a recorded log in place of a simulation, on a graph of its own.

    with LogPlayer(Path("flight.mcap")) as player, BridgeHost(player.gateway) as bridges:
        bridges.open(RosbridgeServer())
        player.run()

Its clock is that of the log; it can be paused, paced and set to any time. Nothing is simulated:
commands of clients have no effect.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path

from volery.core.clock import NS_PER_S
from volery.engine.call_budget import CallBudget
from volery.graph.messages import Clock, time_from_ns
from volery.graph.session import Gateway
from volery.runtime.monitoring.progress import Progress
from volery.runtime.replay.playback_control import PlaybackControl
from volery.runtime.services.player import PlayerServices
from volery.runtime.services.worlds import OnLoad
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.schema import Scenario

_SLICE_S = 0.004
"""Wall time between two checks for due messages during playback, s."""
_CLOCK_S = 0.02
_STATE_S = 0.2
"""Wall time between two messages, s."""
_SLACK_S = 0.25
"""Greatest lag, s of wall time, that playback makes up for; beyond, due times move."""
_GLANCE_S = 0.05
_NEWCOMERS = "new subscribers"


class LogPlayer(PlaybackControl):
    """Plays the log at `path` on a graph of its own.

    speed: factor of real time; None: as fast as possible. loop: whether playback starts over at the
    end; else it pauses there. on_load: called with the name of a scenario that a client requests,
    or with None for no world. on_close: called when a client closes the log. catalog: scenarios and
    logs that clients can choose. own: the user's own scenario of the log's flight, for files that
    its world needs; None: the catalog's scenario of that name, or files beside the log. Methods
    belong to one thread, which calls `wait` or `run`; others use `Gateway.post`. Raises
    `RecordingError` if there is no log, or no message in it.
    """

    operators = None
    """Playback has no UAVs to control."""
    waits_at_end = False

    def __init__(
        self,
        path: Path | str,
        *,
        speed: float | None = 1.0,
        loop: bool = False,
        paused: bool = False,
        on_load: OnLoad | None = None,
        on_close: Callable[[], None] | None = None,
        catalog: ScenarioCatalog | None = None,
        own: Scenario | None = None,
    ) -> None:
        super().__init__(path, speed=speed, loop=loop, paused=paused, catalog=catalog, own=own)
        self.gateway = Gateway(
            self.graph,
            self._inbox.post,
            open_queue=lambda: self._inbox.open_queue().post,
            is_busy=lambda: self._is_busy,
            is_late=lambda: self._is_late,
        )
        self._budget = CallBudget()
        """Budget for reading the log for new subscribers, all together."""
        self._clock = self.graph.advertise("/clock", Clock)
        self._playback.open(self.graph)
        self._services = PlayerServices(self, on_load, catalog, on_close)
        self._rebase()

    # --------------------------------------------------------------------------------- its owner

    def run(
        self,
        seconds: float | None = None,
        *,
        on_progress: Callable[[Progress], None] | None = None,
    ) -> None:
        """Plays and serves clients for `seconds` of wall time; None: until `quit`.

        on_progress: called about twenty times a second, also during a pause.
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
        """Plays and serves clients for a wall time, s."""
        until = time.perf_counter() + timeout_s
        while True:
            self._serve()
            self._show_to_newcomers()
            self._play()
            self._publish_state()
            self.graph.deliver()
            left = until - time.perf_counter()
            if left <= 0.0 or self.quitting:
                return
            self._inbox.wait(min(left, _STATE_S if self._paused else self._pause_s))

    def close(self) -> None:
        """Closes the log."""
        self.quitting = True
        self._playback.close()

    def __enter__(self) -> LogPlayer:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    # ------------------------------------------------------------------------------------ inside

    @property
    def _pause_s(self) -> float:
        """Wall time between two checks during playback, s; 0 at unlimited speed."""
        return 0.0 if self._speed is None else _SLICE_S

    @property
    def _is_busy(self) -> bool:
        """Whether playback leaves no time for clients."""
        return not self._paused and (self._is_late or self._speed is None)

    @property
    def _idle_s(self) -> float:
        """Wall time that clients may use now without a charge, s."""
        if self._paused:
            return math.inf
        return 0.0 if self._is_busy else _SLICE_S

    def _serve(self) -> None:
        """Processes requests of clients."""
        self._inbox.serve(self.graph.deliver, self._idle_s)

    def _show_to_newcomers(self) -> None:
        """Publishes the last messages to new subscribers, as soon as the budget allows."""
        self._budget.earn()
        if self._budget.may_spend(_NEWCOMERS):
            before_s = time.thread_time()
            self._playback.show_to_newcomers()
            self.graph.deliver()
            self._budget.spend(_NEWCOMERS, time.thread_time() - before_s)

    def _play(self) -> None:
        """Publishes due messages, for a slice of wall time at most."""
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
        """Returns the time of the log that is due at a wall time."""
        if self._speed is None:
            return self._playback.end_ns
        due_ns = self._base_ns + round((now - self._base_wall) * self._speed * NS_PER_S)
        late_ns = due_ns - self.time_ns
        slack_ns = round(_SLACK_S * self._speed * NS_PER_S)
        if late_ns > slack_ns:
            due_ns = self.time_ns + slack_ns
            self._base_ns, self._base_wall = due_ns, now
        return due_ns

    def _publish_state(self) -> None:
        """Publishes clock and state when they are due."""
        now = time.perf_counter()
        if now >= self._clock_due and (not self._paused or not self._clock_due):
            self._clock_due = now + _CLOCK_S
            self._clock.publish(Clock(time_from_ns(self._playback.now_ns)))
        if now >= self._state_due:
            self._state_due = now + _STATE_S
            self._services.publish_state()
