"""Flies one run as a simulation of its own, with a log if one is wanted."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.recorded_topics import recorded_topics
from volery.runtime.simulation import Simulation
from volery.scenario.schema import Scenario
from volery.verdicts.finished_run import FinishedRun
from volery.verdicts.flights import RunRecorder


class SingleRun:
    """A simulation that flies a run to its end.

    log: file to be recorded; None: none. needs: parts of the finished run that are read.
    """

    def __init__(
        self, scenario: Scenario, rate_hz: float, log: Path | None, needs: Collection[str]
    ) -> None:
        self._simulation = Simulation(scenario, threads=1)
        self._rate_hz = rate_hz
        self._log = log
        self._needs = needs

    def fly(self) -> FinishedRun:
        """Flies to the end; the simulation stays open. Raises what ends the flight early."""
        simulation = self._simulation
        start = time.perf_counter()
        with (
            RunRecorder(simulation, self._needs, self._rate_hz) as recorder,
            _recorded(simulation, self._log),
        ):
            simulation.run()
        return recorder.finished(time.perf_counter() - start, self._log)

    def __enter__(self) -> SingleRun:
        return self

    def __exit__(self, *_exception: object) -> None:
        self._simulation.close()


@contextmanager
def _recorded(simulation: Simulation, path: Path | None) -> Iterator[None]:
    """Records all topics into a log while the body runs; the log is closed after an error, too."""
    if path is None:
        yield
        return
    log = create_log(path, overwrite=True)
    try:
        matches = recorded_topics(simulation.graph)
        subscription = simulation.graph.subscribe_all(log.write, matches)
        try:
            yield
        finally:
            simulation.commands.end()
            subscription.cancel()
    finally:
        log.close()
