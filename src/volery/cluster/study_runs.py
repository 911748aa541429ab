"""Runs a study: `run_study`, and what the command line needs of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from volery.cluster.batches import StudyJob
from volery.cluster.driver import StudyDriver, SweepProgress
from volery.cluster.errors import StudyError
from volery.cluster.executor import Executor
from volery.cluster.inline_executor import InlineExecutor
from volery.cluster.loading import LoadedStudy, load_study
from volery.cluster.metric_names import fingerprint_of, metrics_of
from volery.cluster.plan import RunPlan
from volery.cluster.pool_worker import PoolWorker, Replies
from volery.cluster.process_worker import ProcessWorker
from volery.cluster.results_folder import ResultsFolder
from volery.cluster.runs import RunResult, RunSpec, runs_of
from volery.cluster.study import Study
from volery.cluster.table import StudyTable, arrow_module
from volery.cluster.worker_pool import WorkerPool
from volery.core.machine import usable_cores

TABLE_FILE = "table.parquet"
ExecutorFactory = Callable[[StudyJob], Executor]


@dataclass(frozen=True)
class SweepOptions:
    """How a study is run."""

    results: Path
    """Folder of the results."""
    workers: int | None = None
    """Number of worker processes; None: one for each core; 0: this process flies."""
    part: tuple[int, int] | None = None
    """Part i of n of the runs, i from 1; None: all."""
    retry_failed: bool = False
    """Whether failed runs are flown again."""
    executor: ExecutorFactory | None = None
    """Makes the executor; None: processes on this machine."""
    on_progress: Callable[[SweepProgress], None] | None = None
    """Called about five times a second."""
    reuses_results: bool = True
    """Whether runs that have results are not flown again; else results and logs are removed."""


def run_study(
    study: str | Path | Mapping[str, Any] | Study,
    results: str | Path | None = None,
    *,
    workers: int | None = None,
    ray: str | None = None,
    retry_failed: bool = False,
    trust: bool = False,
    on_progress: Callable[[SweepProgress], None] | None = None,
) -> StudyTable:
    """Flies the missing runs of a study and returns the table of all runs.

    study: a TOML file, plain data or a `Study`. results: folder of the results, which are reused;
    default: `runs/NAME`. workers: number of processes; None: one for each core; 0: this process
    flies, for a debugger. ray: address of a Ray cluster that flies them. retry_failed: whether
    failed runs are flown again. trust: whether metrics and nodes may be modules beside the study.
    on_progress: called about five times a second. Also writes `table.parquet` into the folder.
    Raises `StudyError`, naming file, key and allowed values, for an invalid study, and if another
    driver uses the folder or the disk is full.
    """
    loaded = load_study(study, trust=trust)
    folder = Path("runs") / loaded.study.name if results is None else Path(results)
    executor = None if ray is None else on_ray(ray, workers)
    options = SweepOptions(folder, workers, None, retry_failed, executor, on_progress)
    return fly_study(loaded, options)


def on_ray(address: str, workers: int | None = None) -> ExecutorFactory:
    """Returns what makes executors on a Ray cluster; see `ray_worker.ray_pool`."""

    def start(job: StudyJob) -> Executor:
        from volery.cluster.ray_worker import ray_pool

        return ray_pool(job, address, workers)

    return start


def fly_study(loaded: LoadedStudy, options: SweepOptions) -> StudyTable:
    """Flies the missing runs of a study, or of a part of it; returns their table.

    The table of all runs is also written into the results folder. Raises `StudyError` as
    `run_study`.
    """
    arrow_module("`volery sweep`")
    folder = ResultsFolder(options.results)
    with folder.locked(options.part):
        plan = _plan_of(loaded, options, folder)
        try:
            _fly_missing(loaded, options, plan, folder)
        finally:
            table = table_of(loaded, plan, folder)
            if options.part is None:
                folder.write_file(folder.path / TABLE_FILE, table.parquet())
    return table


def fly_runs(loaded: LoadedStudy, options: SweepOptions) -> RunPlan:
    """Flies the missing runs of a study and returns them with their results; writes no table.

    Raises `StudyError` as `run_study`.
    """
    folder = ResultsFolder(options.results)
    with folder.locked(options.part):
        plan = _plan_of(loaded, options, folder)
        _fly_missing(loaded, options, plan, folder)
    return plan


def table_of(loaded: LoadedStudy, plan: RunPlan, folder: ResultsFolder) -> StudyTable:
    """Returns the table of the wanted runs that have results."""
    names = [entry.name for entry in metrics_of(loaded.study)]
    runs = list(plan.wanted())
    return StudyTable(runs, plan.results, list(loaded.study.parameters), names, folder.path)


def stored_plan(loaded: LoadedStudy, results: Path) -> RunPlan:
    """Returns the plan of a study with the results that its folder has; nothing is flown."""
    return _plan_of(loaded, SweepOptions(results), ResultsFolder(results))


# ------------------------------------------------------------------------------------------ inside


def _plan_of(loaded: LoadedStudy, options: SweepOptions, folder: ResultsFolder) -> RunPlan:
    """Returns the runs of a study, or of a part of it, with the results that exist."""
    runs = _part_of(loaded, list(runs_of(loaded)), options.part)
    if not options.reuses_results:
        folder.clear()
    prints, known = fingerprints_of(loaded), folder.read_all(runs)
    usable = {k: r for k, r in known.items() if _is_usable(r, prints, options.retry_failed)}
    return RunPlan(runs, usable, loaded.study.stop)


def _fly_missing(
    loaded: LoadedStudy, options: SweepOptions, plan: RunPlan, folder: ResultsFolder
) -> None:
    if not plan.has_missing and not _without_logs(loaded, options, plan, folder):
        return
    executor = executor_of(loaded, options, folder)
    try:
        prints = fingerprints_of(loaded)
        driver = StudyDriver(loaded.study, plan, executor, folder, prints, options.on_progress)
        prepared = executor.prepare()
        if loaded.study.vectorized is True and prepared.obstacle:
            raise StudyError(f"{loaded.where}: key 'vectorized': {prepared.obstacle}")
        driver.run(prepared)
        missing_logs = _without_logs(loaded, options, plan, folder)
        if missing_logs:
            driver.record(missing_logs)
    finally:
        executor.close()


def executor_of(loaded: LoadedStudy, options: SweepOptions, folder: ResultsFolder) -> Executor:
    """Returns the executor of the options; by default processes on this machine."""
    study = loaded.study
    job = StudyJob(
        study,
        loaded.where,
        loaded.folder,
        loaded.is_trusted,
        loaded.points[0],
        folder.logs.resolve(),
    )
    if options.executor is not None:
        return options.executor(job)
    if options.workers == 0:
        return InlineExecutor(job)
    programs = folder.path / "workers"
    folder.make(programs)

    def start(number: int, replies: Replies) -> PoolWorker:
        return ProcessWorker(number, programs / f"worker_{number}.log", replies)

    return WorkerPool(job, options.workers or usable_cores(), start)


def _part_of(
    loaded: LoadedStudy, runs: list[RunSpec], part: tuple[int, int] | None
) -> list[RunSpec]:
    """Returns part i of n; of a study with a stop rule, whole parameter points."""
    if part is None:
        return runs
    number, parts = part
    if not 1 <= number <= parts:
        raise StudyError(f"--part {number}/{parts}: a part is 1/{parts} to {parts}/{parts}")
    if loaded.study.stop is not None:
        return [run for run in runs if run.point % parts == number - 1]
    return runs[number - 1 :: parts]


def fingerprints_of(loaded: LoadedStudy) -> dict[str, str]:
    """Returns the hashes of a study's metrics by name."""
    return {e.name: fingerprint_of(e, loaded.folder) for e in metrics_of(loaded.study)}


def _is_usable(result: RunResult, prints: Mapping[str, str], retry_failed: bool) -> bool:
    """Returns whether a result answers the study: it has its metrics, or failed with them."""
    if result.is_failed and retry_failed:
        return False
    return all(result.fingerprints.get(name) == value for name, value in prints.items())


def _without_logs(
    loaded: LoadedStudy, options: SweepOptions, plan: RunPlan, folder: ResultsFolder
) -> list[RunSpec]:
    """Returns the runs whose log is wanted and missing."""
    study = loaded.study
    if plan.has_missing:
        return []
    runs = [run for run in plan.wanted() if run.id in plan.results]
    if study.logs == "none" or (study.logs == "worst" and options.part is not None):
        return []
    if study.logs == "worst":
        runs = worst_runs(loaded, plan)
    elif study.logs == "failed":
        runs = [run for run in runs if _has_failed(plan.results[run.id])]
    return [
        run
        for run in runs
        if not plan.results[run.id].error.startswith("its worker")
        and not (plan.results[run.id].log and (folder.path / plan.results[run.id].log).exists())
    ]


def _has_failed(result: RunResult) -> bool:
    return not result.is_passed or result.metrics.get("success") == 0.0


def worst_runs(loaded: LoadedStudy, plan: RunPlan, count: int | None = None) -> list[RunSpec]:
    """Returns the finished runs with the worst values of the study's metric, worst first."""
    entries = {entry.name: entry for entry in metrics_of(loaded.study)}
    worst = loaded.study.worst
    name = next(iter(entries)) if worst is None else worst.metric
    sign = 1.0 if entries[name].worst == "low" else -1.0
    rated: list[tuple[float, int, RunSpec]] = []
    for run in plan.wanted():
        value = plan.results[run.id].metrics.get(name) if run.id in plan.results else None
        if value is not None and not math.isnan(value):
            rated.append((sign * value, len(rated), run))
    num_runs = count or (5 if worst is None else worst.count)
    return [run for _, _, run in sorted(rated, key=lambda each: each[:2])[:num_runs]]
