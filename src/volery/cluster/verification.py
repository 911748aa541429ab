"""Repeats finished runs of a study: to compare their results, or to record their logs."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from volery.cluster.batches import RunBatch
from volery.cluster.driver import StudyDriver
from volery.cluster.errors import StudyError
from volery.cluster.executor import BatchLoss, Executor
from volery.cluster.loading import LoadedStudy
from volery.cluster.metric_names import UNREPEATABLE
from volery.cluster.results_folder import ResultsFolder
from volery.cluster.runs import RunResult, RunSpec
from volery.cluster.study_runs import (
    SweepOptions,
    executor_of,
    fingerprints_of,
    stored_plan,
)


@dataclass(frozen=True)
class RunDifference:
    """A run that differed when it was repeated."""

    run: str
    """Identity of the run."""
    what: str
    """What differs, as text."""


def verify_study(
    loaded: LoadedStudy, options: SweepOptions, count: int
) -> tuple[int, list[RunDifference]]:
    """Repeats a sample of finished runs, each as a plain simulation with all its sensors.

    Returns the number of repeated runs, and those whose digest or metrics differ. Raises
    `StudyError` if no run has finished.
    """
    folder = ResultsFolder(options.results)
    plan = stored_plan(loaded, options.results)
    done = [run for run in plan.wanted() if _is_done(plan.results.get(run.id))]
    if not done:
        raise StudyError(f"{loaded.where}: no run has finished yet in {folder.path}")
    chosen = sorted(done, key=lambda run: hashlib.sha256(run.id.encode()).digest())[:count]
    differences: list[RunDifference] = []
    with folder.locked():
        executor = executor_of(loaded, options, folder)
        try:
            executor.prepare()
            for result in _repeated(executor, chosen):
                found = _difference(plan.results[result.id], result)
                differences += [] if found is None else [found]
        finally:
            executor.close()
    return len(chosen), differences


def record_runs(loaded: LoadedStudy, options: SweepOptions, runs: Sequence[RunSpec]) -> None:
    """Flies finished runs again and keeps a log of each in the results folder."""
    folder = ResultsFolder(options.results)
    with folder.locked():
        plan = stored_plan(loaded, options.results)
        executor = executor_of(loaded, options, folder)
        try:
            executor.prepare()
            prints = fingerprints_of(loaded)
            StudyDriver(loaded.study, plan, executor, folder, prints).record(runs)
        finally:
            executor.close()


def _is_done(result: RunResult | None) -> bool:
    return result is not None and not result.is_failed


def _repeated(executor: Executor, runs: Sequence[RunSpec]) -> list[RunResult]:
    waiting = [RunBatch(k, (run,), plain=True) for k, run in enumerate(runs)]
    left = len(waiting)
    found: list[RunResult] = []
    while left:
        while waiting and executor.can_submit():
            executor.submit(waiting.pop(0))
        for each in executor.collect(1.0):
            left -= 1
            if isinstance(each, BatchLoss):
                raise StudyError(f"a run could not be repeated: its worker {each.reason}")
            found += each.results
    return found


def _difference(first: RunResult, second: RunResult) -> RunDifference | None:
    if second.is_failed:
        return RunDifference(first.id, f"the repeated run failed: {second.error}")
    if first.digest != second.digest:
        return RunDifference(first.id, f"digests {first.digest[:16]} and {second.digest[:16]}")
    for name, value in first.metrics.items():
        other = second.metrics.get(name)
        is_same = repr(value) == repr(other)  # nan equals itself here
        if name not in UNREPEATABLE and not is_same:
            return RunDifference(first.id, f"{name} {value!r} and {other!r}")
    return None
