"""Flies one run as a simulation of its own, with a log if one is wanted."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.recorded_topics import recorded_topics
from volery.cluster.finished_run import Estimates, FinishedRun
from volery.graph.messages import Published, stamp_of
from volery.report.logged_flights import ESTIMATES
from volery.runtime.simulation import Simulation
from volery.scenario.schema import Scenario


class SingleRun:
    """A simulation that flies a run to its end.

    log: file to be recorded; None: none. records_estimates: whether poses that UAVs estimate are
    kept for metrics.
    """

    def __init__(
        self, scenario: Scenario, rate_hz: float, log: Path | None, *, records_estimates: bool
    ) -> None:
        self._simulation = Simulation(scenario, threads=1)
        self._rate_hz = rate_hz
        self._log = log
        self._records_estimates = records_estimates

    def fly(self) -> FinishedRun:
        """Flies to the end; the simulation stays open. Raises what ends the flight early."""
        simulation = self._simulation
        start = time.perf_counter()
        estimates = _EstimateRecorder(simulation) if self._records_estimates else None
        with _recorded(simulation, self._log):
            flight = simulation.fly(rate_hz=self._rate_hz)
        return FinishedRun(
            flight=flight,
            scenario=simulation.scenario,
            airframes={name: uav.airframe for name, uav in simulation.uavs.items()},
            scene=simulation.world.scene,
            wall_s=time.perf_counter() - start,
            simulation=simulation,
            estimates=None if estimates is None else estimates.trajectories(),
            log=self._log,
        )

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


class _EstimateRecorder:
    """Records the poses that UAVs estimate, from the best topic of each."""

    def __init__(self, simulation: Simulation) -> None:
        self._rows: dict[str, list[tuple[float, float, float, float]]] = {}
        topics = {info.name: info.msgtype for info in simulation.graph.topics()}
        for name in simulation.uavs:
            found = [f"/{name}/{end}" for end in ESTIMATES if f"/{name}/{end}" in topics]
            if found:
                rows = self._rows.setdefault(name, [])
                simulation.graph.subscribe(found[0], _receiver(rows), topics[found[0]])

    def trajectories(self) -> Estimates:
        """Returns the estimated trajectories by UAV."""
        found = {}
        for name, rows in self._rows.items():
            table = np.array(rows, np.float64).reshape(-1, 4)
            found[name] = (table[:, 0], table[:, 1:])
        return found


def _receiver(rows: list[tuple[float, float, float, float]]) -> Any:
    def receive(published: Published) -> None:
        message = published.message
        pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
        time_s = (stamp_of(message) or published.time_ns) * 1e-9
        p = pose.position
        if np.isfinite((p.x, p.y, p.z)).all() and (not rows or time_s > rows[-1][0]):
            rows.append((time_s, p.x, p.y, p.z))

    return receive
