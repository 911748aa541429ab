"""Drives a study: hands its missing runs to an executor and stores their results."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from volery.cluster.batches import BatchResult, Preparation, RunBatch
from volery.cluster.executor import BatchLoss, Executor, WorkerState
from volery.cluster.plan import RunPlan
from volery.cluster.results_folder import ResultsFolder
from volery.cluster.runs import RunResult, RunSpec, failure_of
from volery.cluster.study import Study
from volery.cluster.worker_pool import TIMED_OUT

_BATCH_S = 0.25
"""Wall time that a batch of single runs should take."""
_MAX_BATCH = 64
_MAX_ENVIRONMENTS = 256
_COLLECT_S = 0.2
_MAX_LOSSES = 2
"""Lost workers after which a run counts as failed."""


@dataclass(frozen=True)
class SweepProgress:
    """How far a study is, for displays."""

    done: int
    """Runs with results, failed ones too."""
    failed: int
    """Failed runs among them."""
    total: int
    """Runs that are wanted so far."""
    flown: int
    """Runs of this driver."""
    elapsed_s: float
    """Wall time since the first run, s."""
    workers: Sequence[WorkerState]
    """State of each worker."""
    obstacle: str
    """What keeps runs from being environments; empty: nothing."""

    @property
    def left_s(self) -> float:
        """Wall time until the end at the present rate, s; inf if it is unknown."""
        if not self.flown:
            return math.inf
        return self.elapsed_s / self.flown * (self.total - self.done)


class StudyDriver:
    """Flies the missing runs of a plan; each result is on the disk before it counts.

    fingerprints: of the study's metrics, for results of failed runs. on_progress: called after
    results, and about five times a second of wall time; it may raise, which ends the study.
    """

    def __init__(
        self,
        study: Study,
        plan: RunPlan,
        executor: Executor,
        folder: ResultsFolder,
        fingerprints: dict[str, str],
        on_progress: Callable[[SweepProgress], None] | None = None,
    ) -> None:
        self._study, self._plan = study, plan
        self._executor, self._folder = executor, folder
        self._fingerprints = fingerprints
        self._on_progress = on_progress
        self._flying: dict[int, RunBatch] = {}
        self._losses: dict[str, int] = {}
        self._singles: list[RunSpec] = []
        """Runs of lost batches; each is flown alone."""
        self._numbers = 0
        self._flown = 0
        self._failed = sum(result.is_failed for result in plan.results.values())
        self._start = time.monotonic()
        self._last_run_s = 0.0
        self._prepared = Preparation({})

    def run(self, prepared: Preparation) -> None:
        """Flies all missing runs. Raises `StudyError` if results cannot be stored."""
        self._prepared = prepared
        self._start = time.monotonic()
        while self._plan.has_missing or self._singles or self._flying:
            while self._executor.can_submit() and (batch := self._next_batch()) is not None:
                self._submit(batch)
            self._collect()
            self._show()

    def record(self, runs: Sequence[RunSpec]) -> None:
        """Flies runs again with a log of each; their results then name it."""
        waiting = list(runs)
        while waiting or self._flying:
            while waiting and self._executor.can_submit():
                self._submit(self._batch((waiting.pop(0),), record=True))
            self._collect()
            self._show()

    # ------------------------------------------------------------------------------------- inside

    def _next_batch(self) -> RunBatch | None:
        if self._singles:
            return self._batch((self._singles.pop(0),))
        if self._study.vectorized is not False and not self._prepared.obstacle:
            limit = min(_MAX_ENVIRONMENTS, self._prepared.max_environments)
            missing = self._plan.missing_of_next_point(limit * self._executor.num_workers)
            count = min(limit, math.ceil(missing / self._executor.num_workers))
            if count > 1:
                return self._batch(self._plan.take(count), vectorized=True)
        count = 1
        if self._last_run_s > 0.0:
            count = max(1, min(_MAX_BATCH, round(_BATCH_S / self._last_run_s)))
        runs = self._plan.take(count)
        return self._batch(runs) if runs else None

    def _batch(
        self, runs: tuple[RunSpec, ...], *, vectorized: bool = False, record: bool = False
    ) -> RunBatch:
        self._numbers += 1
        return RunBatch(self._numbers, runs, vectorized=vectorized, record=record)

    def _submit(self, batch: RunBatch) -> None:
        self._flying[batch.number] = batch
        self._executor.submit(batch)

    def _collect(self) -> None:
        for found in self._executor.collect(_COLLECT_S):
            if isinstance(found, BatchResult):
                batch = self._flying.pop(found.number)
                for run, result in zip(batch.runs, found.results, strict=True):
                    self._store(run, result)
            else:
                self._lose(found)

    def _store(self, run: RunSpec, result: RunResult) -> None:
        if result.is_failed:
            result = replace(result, fingerprints=self._fingerprints)
        before = self._plan.results.get(run.id)
        self._folder.write(result)
        self._plan.add(run, result)
        self._flown += before is None
        self._failed += result.is_failed - (before is not None and before.is_failed)
        self._last_run_s = result.wall_s or self._last_run_s

    def _lose(self, loss: BatchLoss) -> None:
        """Submits the runs of a lost batch again, one by one; one that is lost again has failed."""
        self._flying.pop(loss.batch.number)
        runs = loss.batch.runs
        if len(runs) > 1:
            self._singles += runs
            return
        losses = self._losses[runs[0].id] = self._losses.get(runs[0].id, 0) + 1
        if losses < _MAX_LOSSES and not loss.reason.startswith(TIMED_OUT):
            self._singles.append(runs[0])
        else:
            self._store(runs[0], failure_of(runs[0], f"its worker {loss.reason}"))

    def _show(self) -> None:
        if self._on_progress is not None:
            self._on_progress(
                SweepProgress(
                    done=len(self._plan.results),
                    failed=self._failed,
                    total=self._plan.total,
                    flown=self._flown,
                    elapsed_s=time.monotonic() - self._start,
                    workers=self._executor.states(),
                    obstacle=self._prepared.obstacle,
                )
            )
