"""Judges a flight while it goes on, for `/volery/verdicts`."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

from volery.core.clock import ns_from_s
from volery.graph.messages import Published, String
from volery.verdicts.flights import RunRecorder
from volery.verdicts.judging import Judge
from volery.verdicts.verdict import Verdict

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

TOPIC = "/volery/verdicts"
_PERIOD_S = 1.0
_WALL_PER_JUDGMENT = 50.0
"""Wall time between two judgments, relative to what the last one took: they cost 2 % at most."""


def verdicts_message(verdicts: Sequence[Verdict], time_s: float, *, is_over: bool) -> Published:
    """Returns verdicts as the message of `/volery/verdicts`.

    Its text is a JSON table: `time_s`, the simulated time up to which the flight is judged; `over`,
    whether it is over; `verdicts`, those of `Verdict.to_data`.
    """
    data = [verdict.to_data() for verdict in verdicts]
    text = json.dumps({"time_s": time_s, "over": is_over, "verdicts": data})
    return Published(TOPIC, String.__msgtype__, ns_from_s(time_s), String(text))


class LiveVerdicts:
    """Judges a flight from now on by the expectations of its scenario, for clients and at its end.

    The topic is for external clients alone, as verdicts may depend on wall time. Raises
    `ScenarioError` for a predicate that does not exist or may not be imported.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._judge = Judge(simulation.scenario)
        self._publisher = simulation.graph.advertise(TOPIC, String)
        self._begin()

    def look(self) -> None:
        """Publishes the verdicts so far to external clients; call it between ticks."""
        if self._end_s is not None and self._simulation.time_s < self._end_s:
            self._begin()  # after a reset
        now_s, publisher = time.perf_counter(), self._publisher
        watchers, time_s = publisher.num_external_subscriptions, self._simulation.time_s
        is_fresh = watchers == self._watchers and (now_s < self._due_s or time_s == self._judged_s)
        if is_fresh or not publisher.has_external_subscribers:
            return
        if self._end_s is None:
            run = self._recorder.finished(self._wall_s)
            verdicts = self._judge.verdicts(run, is_over=False)
            self._last = verdicts_message(verdicts, time_s, is_over=False)
            took_s = time.perf_counter() - now_s
            self._due_s = now_s + max(_PERIOD_S, _WALL_PER_JUDGMENT * took_s)
        self._watchers, self._judged_s = watchers, time_s
        publisher.publish_external(self._last.message)

    def finish(self, wall_s: float | None = None) -> tuple[Verdict, ...]:
        """Ends the recording, publishes the verdicts and returns them.

        wall_s: wall time of the flight, s; None: that since this began, without pauses.
        """
        self._recorder.stop()
        run = self._recorder.finished(self._wall_s if wall_s is None else wall_s)
        verdicts = self._judge.verdicts(run)
        self._end_s = self._simulation.time_s
        self._last = verdicts_message(verdicts, self._end_s, is_over=True)
        if self._publisher.has_external_subscribers:
            self._publisher.publish_external(self._last.message)
        return verdicts

    @property
    def last(self) -> Published:
        """The last message, also if no client has received it."""
        return self._last

    def _begin(self) -> None:
        """Records and judges the flight from the present time on."""
        self._recorder = RunRecorder(self._simulation, self._judge.needs)
        self._start_s = time.perf_counter() - self._simulation.clock.paused_s
        self._last = verdicts_message((), self._simulation.time_s, is_over=False)
        self._end_s: float | None = None
        """Simulated time at which the flight was over; None: it goes on."""
        self._watchers = 0
        """Number of external subscriptions that have received the last message."""
        self._judged_s = -1.0
        self._due_s = 0.0

    @property
    def _wall_s(self) -> float:
        return time.perf_counter() - self._start_s - self._simulation.clock.paused_s
