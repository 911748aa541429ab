"""Flies runs of a study in this process, whatever brings them here."""

from __future__ import annotations

import errno
import gc
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from volery.cluster.batches import BatchResult, Preparation, RunBatch, StudyJob
from volery.cluster.environment_flights import fly_environments, max_environments, obstacle
from volery.cluster.errors import StudyError
from volery.cluster.loading import LoadedStudy, scenario_of_study
from volery.cluster.metric_names import metrics_of
from volery.cluster.metrics import load_metrics
from volery.cluster.points import Point
from volery.cluster.runs import RunResult, RunSpec, code_version, failure_of, versions
from volery.cluster.single_runs import SingleRun
from volery.core.errors import FAILURES, VoleryError
from volery.runtime.simulation import Simulation
from volery.scenario.schema import Scenario
from volery.verdicts.failure_map import failure_png
from volery.verdicts.finished_run import NEEDS_SIMULATION, FinishedRun, digest_of
from volery.verdicts.judging import Judge

_DISK_FULL = os.strerror(errno.ENOSPC)
_OF_SENSORS = {"simulation", "estimates", "topics"}
"""Parts of a finished run that sensors make."""
_TRIAL_S = 0.01
"""Simulated time flown before the first run, s."""


class DiskFullError(StudyError):
    """No space is left for logs or results."""


def started_worker(job: StudyJob) -> tuple[RunWorker | None, Preparation]:
    """Returns a worker that is ready to fly, and what it found out.

    None: no run of the study can start. For processes that serve one study only.
    """
    if job.is_trusted:  # metrics may import modules beside them when they are called
        sys.path += [str(job.folder), str(Path().resolve())]
    try:
        worker = RunWorker(job)
        prepared = worker.prepare()
    except VoleryError as error:
        return None, Preparation(versions(), error=" ".join(str(error).split()))
    gc.collect()
    gc.freeze()  # modules and compiled code outlive all runs
    return worker, prepared


class RunWorker:
    """Flies the runs of one study; keeps what they share."""

    def __init__(self, job: StudyJob) -> None:
        self._job = job
        self._study = study = job.study
        self._entries = metrics_of(study)
        self._metrics = load_metrics(self._entries, job.folder)
        scenario = scenario_of_study(study, job.where, job.folder, trust=job.is_trusted)
        self._loaded = LoadedStudy(study, job.where, job.folder, job.is_trusted, scenario, ())
        self._needs = {name for metric in self._metrics for name in metric.needs}
        self._judges = "verdicts" in self._needs
        if self._judges:
            self._needs |= Judge(scenario).needs
        self._point: tuple[Point, Scenario, Scenario, Judge | None] | None = None

    def prepare(self) -> Preparation:
        """Compiles what runs call, and flies the first parameter point for a moment."""
        scenario = self._scenarios(self._job.first_point)[0]
        try:
            with Simulation(scenario, threads=1) as simulation:
                simulation.fly(min(_TRIAL_S, scenario.duration_s))
        except VoleryError as error:
            return Preparation(versions(), error=" ".join(str(error).split()))
        metric = next((m.entry.name for m in self._metrics if m.needs_simulation), None)
        reason = f"metric '{metric}' needs a simulation of its own" if metric else ""
        if self._needs & set(NEEDS_SIMULATION) and not reason:
            reason = "an expectation needs a simulation of its own"
        if self._study.logs == "all":
            reason = "all runs are recorded"
        max_envs = max_environments(scenario, self._study.sample_rate_hz)
        return Preparation(versions(), reason or obstacle(scenario), max_envs)

    def fly(self, batch: RunBatch) -> BatchResult:
        """Flies a batch; a run that fails has the traceback in its result.

        Raises `DiskFullError` if a log cannot be written for lack of space.
        """
        found: list[RunResult] | None = None
        if batch.vectorized and not (batch.record or batch.plain):
            found = self._fly_together(batch.runs)
        if found is None:
            found = [self._fly_alone(run, batch) for run in batch.runs]
        return BatchResult(batch.number, tuple(found))

    # ------------------------------------------------------------------------------------- inside

    def _scenarios(self, values: Point) -> tuple[Scenario, Scenario, Judge | None]:
        """Returns a point's scenario, the same without idle sensors, and its judge."""
        if self._point is None or self._point[0] != values:
            scenario = self._loaded.scenario_of(values)
            lean = scenario
            if self._study.sensors == "needed" and _can_fly_without_sensors(scenario):
                lean = scenario.with_({"types.*.sensors": []})
            self._point = values, scenario, lean, Judge(scenario) if self._judges else None
        return self._point[1:]

    def _fly_together(self, runs: Sequence[RunSpec]) -> list[RunResult] | None:
        """Flies runs as environments; None if one fails, so that each is flown alone."""
        cpu_s = time.process_time()
        try:
            scenario = self._scenarios(runs[0].values)[1]
            seeds = [run.seed for run in runs]
            rate_hz = self._study.sample_rate_hz
            envs, finished = fly_environments(scenario, seeds, rate_hz)
        except Exception:
            return None
        with envs:
            pairs = zip(runs, finished, strict=True)
            results = [self._measured(run, flown, "") for run, flown in pairs]
        each_s = (time.process_time() - cpu_s) / len(runs)
        return [_with_cpu(result, each_s) for result in results]

    def _fly_alone(self, run: RunSpec, batch: RunBatch) -> RunResult:
        cpu_s = time.process_time()
        keeps_log = (batch.record or self._study.logs == "all") and not batch.plain
        needs_log = keeps_log or "log" in self._needs
        log = self._job.results / f"{run.id}.partial.mcap" if needs_log else None
        kept = f"logs/{run.id}.mcap" if keeps_log else ""
        try:
            scenario, lean, judge = self._scenarios(run.values)
            needs_sensors = batch.plain or needs_log or _OF_SENSORS & self._needs
            chosen = (scenario if needs_sensors else lean).model_copy(update={"seed": run.seed})
            rate_hz = self._study.sample_rate_hz
            with SingleRun(chosen, rate_hz, log, self._needs, judge) as flight:
                flown = flight.fly()
                result = self._measured(run, flown, kept)
            if keeps_log and judge is not None and not result.is_passed:
                image = failure_png(flown.flight, flown.verdicts, chosen.expect)
                (self._job.results / f"{run.id}.png").write_bytes(image)
        except FAILURES as error:
            if _is_disk_full(error):
                raise DiskFullError(f"{self._job.results}: {_DISK_FULL}") from None
            result = failure_of(run, error, kept)
        for path in _closed_log(log):
            if keeps_log:
                path.replace(self._job.results / f"{run.id}.mcap")
            else:
                path.unlink()
        return _with_cpu(result, time.process_time() - cpu_s)

    def _measured(self, run: RunSpec, flown: FinishedRun, log: str) -> RunResult:
        values: dict[str, float] = {}
        judge = self._scenarios(run.values)[2]
        try:
            if judge is not None and not flown.verdicts:  # flown among other environments
                flown = replace(flown, verdicts=judge.verdicts(flown))
            for metric in self._metrics:
                values.update(metric.values(flown))
        except FAILURES as error:
            return failure_of(run, error, log)
        return RunResult(
            id=run.id,
            status="done",
            parameters=dict(run.values),
            seed=run.seed,
            version=code_version(),
            metrics=values,
            fingerprints={m.entry.name: m.fingerprint for m in self._metrics},
            verdicts=[verdict.to_data() for verdict in flown.verdicts],
            digest=digest_of(flown.flight),
            simulated_s=flown.flight.duration_s,
            wall_s=flown.wall_s,
            log=log,
        )


def _with_cpu(result: RunResult, cpu_s: float) -> RunResult:
    return replace(result, cpu_s=cpu_s)


def _can_fly_without_sensors(scenario: Scenario) -> bool:
    """Returns whether nothing within a run reads sensors: no node, estimator, radio or fault."""
    kinds = {sensor.kind for kind in scenario.types.values() for sensor in kind.sensors}
    faults = {fault.kind for fault in scenario.faults}
    has_readers = bool(scenario.node_entries) or scenario.radio is not None
    return not (has_readers or "estimate" in kinds or faults & {"sensor", "gnss_loss"})


def _is_disk_full(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, OSError) and error.errno == errno.ENOSPC:
            return True
        if isinstance(error, VoleryError) and _DISK_FULL in str(error):
            return True
        error = error.__cause__ or error.__context__
    return False


def _closed_log(log: Path | None) -> Iterator[Path]:
    if log is not None and log.exists():
        yield log
