"""Records flights for their verdicts."""

from __future__ import annotations

import time
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from volery.results import FlightResult
from volery.runtime.flight_recorder import DEFAULT_RATE_HZ
from volery.verdicts.finished_run import FinishedRun
from volery.verdicts.judging import Judge
from volery.verdicts.observing import FlightObserver
from volery.verdicts.verdict import Verdict

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation
    from volery.scenario.schema import Scenario


class RunRecorder:
    """Records states and messages of a simulation from now on, as a finished run has them.

    needs: parts of the finished run that are read, such as "topics" and "estimates". It changes no
    results. As a context manager it stops at the end.
    """

    def __init__(
        self, simulation: Simulation, needs: Collection[str], rate_hz: float = DEFAULT_RATE_HZ
    ) -> None:
        self._simulation, self._needs = simulation, needs
        expectations = simulation.scenario.expect if "topics" in needs else ()
        has_estimates = "estimates" in needs
        self._observer = FlightObserver(simulation, expectations, estimates=has_estimates)
        self._states = simulation.record(rate_hz)

    def finished(self, wall_s: float, log: Path | None = None) -> FinishedRun:
        """Returns the run so far. wall_s: its wall time, s; log: its closed log; None: none."""
        simulation = self._simulation
        return FinishedRun(
            flight=self._states.result(),
            scenario=simulation.scenario,
            airframes={name: uav.airframe for name, uav in simulation.uavs.items()},
            scene=simulation.world.scene,
            wall_s=wall_s,
            simulation=simulation,
            estimates=self._observer.estimates() if "estimates" in self._needs else None,
            topics=self._observer.topics,
            log=log,
        )

    def stop(self) -> None:
        """Ends the recording; `finished` returns the run up to now."""
        self._states.stop()
        self._observer.close()

    def __enter__(self) -> RunRecorder:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.stop()


class JudgedFlight(NamedTuple):
    """A flight with its verdicts."""

    flight: FlightResult
    """States of the flight and its events."""
    verdicts: tuple[Verdict, ...]
    """A verdict for each expectation of the scenario."""

    @property
    def is_passed(self) -> bool:
        """Whether the flight passes all expectations."""
        return all(verdict.is_passed for verdict in self.verdicts)


def judged_flight(scenario: Scenario, *, threads: int = 2) -> JudgedFlight:
    """Flies a scenario to its end and judges the flight by its expectations.

    Raises `ScenarioError` for a scenario that cannot start, and what ends the flight early.
    """
    from volery.runtime.simulation import Simulation

    judge = Judge(scenario)
    with Simulation(scenario, threads=threads) as simulation:
        start = time.perf_counter()
        with RunRecorder(simulation, judge.needs) as recorder:
            simulation.run()
        run = recorder.finished(time.perf_counter() - start)
        return JudgedFlight(run.flight, judge.verdicts(run))
