"""Flies one run as a simulation of its own, with a log if one is wanted."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from volery.bridges.logs.log_writer import LogWriter, create_log
from volery.bridges.logs.recorded_topics import recorded_topics
from volery.runtime.simulation import Simulation
from volery.scenario.schema import Scenario
from volery.verdicts.finished_run import FinishedRun
from volery.verdicts.flights import RunRecorder
from volery.verdicts.judging import Judge
from volery.verdicts.live_verdicts import verdicts_message
from volery.verdicts.verdict import Verdict


class SingleRun:
    """A simulation that flies a run to its end.

    log: file to be recorded; None: none. needs: parts of the finished run that are read. judge: of
    the verdicts; None: there are none.
    """

    def __init__(
        self,
        scenario: Scenario,
        rate_hz: float,
        log: Path | None,
        needs: Collection[str],
        judge: Judge | None = None,
    ) -> None:
        self._simulation = Simulation(scenario, threads=1)
        self._rate_hz = rate_hz
        self._log = log
        self._needs = needs
        self._judge = judge

    def fly(self) -> FinishedRun:
        """Flies to the end; the simulation stays open. Raises what ends the flight early.

        The verdicts are in the log, unless one needs the log itself; of a flight that ends early,
        that it has failed.
        """
        simulation, judge = self._simulation, self._judge
        verdicts: tuple[Verdict, ...] = ()
        start = time.perf_counter()
        with (
            RunRecorder(simulation, self._needs, self._rate_hz) as recorder,
            _recorded(simulation, self._log) as log,
        ):
            try:
                simulation.run()
            except Exception as error:
                if judge is not None and log is not None:
                    ended = Verdict.of_flight(f"{type(error).__name__}: {error}")
                    log.write(verdicts_message([ended], simulation.time_s, is_over=True))
                raise
            wall_s = time.perf_counter() - start
            if judge is not None and "log" not in self._needs:
                verdicts = judge.verdicts(recorder.finished(wall_s))
                if log is not None:
                    log.write(verdicts_message(verdicts, simulation.time_s, is_over=True))
        run = recorder.finished(wall_s, self._log)
        if judge is not None and "log" in self._needs:
            verdicts = judge.verdicts(run)
        return replace(run, verdicts=verdicts)

    def __enter__(self) -> SingleRun:
        return self

    def __exit__(self, *_exception: object) -> None:
        self._simulation.close()


@contextmanager
def _recorded(simulation: Simulation, path: Path | None) -> Iterator[LogWriter | None]:
    """Records all topics into a log while the body runs; the log is closed after an error, too."""
    if path is None:
        yield None
        return
    log = create_log(path, overwrite=True)
    try:
        matches = recorded_topics(simulation.graph)
        subscription = simulation.graph.subscribe_all(log.write, matches)
        try:
            yield log
        finally:
            simulation.commands.end()
            subscription.cancel()
    finally:
        log.close()
