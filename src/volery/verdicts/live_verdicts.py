"""Judges a flight while it goes on, for `/volery/verdicts`."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
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


def verdicts_of(text: str) -> list[Verdict]:
    """Returns the verdicts of such a message's text."""
    return [Verdict.from_data(each) for each in json.loads(text)["verdicts"]]


class LiveVerdicts:
    """Judges a flight from now on by the expectations of its scenario, for clients and at its end.

    The topic is for external clients alone, as verdicts may depend on wall time. Raises
    `ScenarioError` for a predicate that does not exist or may not be imported.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._judge = Judge(simulation.scenario)
        self._publisher = simulation.graph.advertise(TOPIC, String)
        self._flight = self._new_flight()

    def look(self) -> None:
        """Publishes the verdicts so far to external clients; call it between ticks."""
        now_s, time_s = time.perf_counter(), self._simulation.time_s
        if self._flight.is_over and time_s < self._flight.judged_s:  # after a reset
            self._flight = self._new_flight()
        flight, watchers = self._flight, self._publisher.num_external_subscriptions
        is_fresh = now_s < flight.due_s or time_s == flight.judged_s
        if not self._publisher.has_external_subscribers:
            return
        if watchers == flight.watchers and (is_fresh or flight.is_over):
            return
        if not flight.is_over:
            verdicts = self._judge.verdicts(flight.recorder.finished(self._wall_s), is_over=False)
            flight.last = verdicts_message(verdicts, time_s, is_over=False)
            flight.judged_s = time_s
            took_s = time.perf_counter() - now_s
            flight.due_s = now_s + max(_PERIOD_S, _WALL_PER_JUDGMENT * took_s)
        flight.watchers = watchers
        self._publisher.publish_external(flight.last.message)

    def finish(self, wall_s: float | None = None, *, is_over: bool = True) -> tuple[Verdict, ...]:
        """Ends the recording, publishes the verdicts and returns them.

        wall_s: wall time of the flight, s; None: that since this began, without pauses. is_over:
        whether the flight went to its end, as in `Judge.verdicts`.
        """
        flight, time_s = self._flight, self._simulation.time_s
        flight.recorder.stop()
        run = flight.recorder.finished(self._wall_s if wall_s is None else wall_s)
        verdicts = self._judge.verdicts(run, is_over=is_over)
        flight.last = verdicts_message(verdicts, time_s, is_over=True)
        flight.is_over, flight.judged_s = True, time_s
        if self._publisher.has_external_subscribers:
            self._publisher.publish_external(flight.last.message)
        return verdicts

    @property
    def last(self) -> Published:
        """The last message, also if no client has received it."""
        return self._flight.last

    def _new_flight(self) -> _Flight:
        """Records and judges the flight from the present time on."""
        return _Flight(
            RunRecorder(self._simulation, self._judge.needs),
            time.perf_counter() - self._simulation.clock.paused_s,
            verdicts_message((), self._simulation.time_s, is_over=False),
        )

    @property
    def _wall_s(self) -> float:
        return time.perf_counter() - self._flight.start_s - self._simulation.clock.paused_s


@dataclass
class _Flight:
    """A flight from a start or reset on."""

    recorder: RunRecorder
    start_s: float
    """Wall time of the start, less the pauses before it."""
    last: Published
    """The last message."""
    is_over: bool = False
    watchers: int = 0
    """Number of external subscriptions that have received the last message."""
    judged_s: float = -1.0
    """Simulated time of the last message."""
    due_s: float = 0.0
    """Wall time of the next judgment."""
