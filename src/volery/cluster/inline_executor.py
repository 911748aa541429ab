"""Flies batches in the driver's own process, for debuggers, notebooks and small studies."""

from __future__ import annotations

from collections.abc import Sequence

from volery.cluster.batches import BatchResult, Preparation, RunBatch, StudyJob
from volery.cluster.errors import StudyError
from volery.cluster.executor import BatchLoss, WorkerState


class InlineExecutor:
    """An executor without processes; see `Executor`. Nothing in it survives a crash of a run."""

    def __init__(self, job: StudyJob) -> None:
        from volery.cluster.run_worker import RunWorker

        self._where = job.where
        self._worker = RunWorker(job)
        self._batch: RunBatch | None = None
        self._runs = 0

    @property
    def num_workers(self) -> int:
        """Number of workers: this process alone."""
        return 1

    def prepare(self) -> Preparation:
        """Returns what the first point's simulation shows; `StudyError` if it cannot be built."""
        found = self._worker.prepare()
        if found.error:
            raise StudyError(f"{self._where}: {found.error}")
        return found

    def can_submit(self) -> bool:
        """Returns whether no batch waits."""
        return self._batch is None

    def submit(self, batch: RunBatch) -> None:
        """Takes a batch; `collect` flies it."""
        self._batch = batch

    def collect(self, timeout_s: float) -> Sequence[BatchResult | BatchLoss]:  # noqa: ARG002
        """Flies the batch to its end and returns its results."""
        batch, self._batch = self._batch, None
        if batch is None:
            return ()
        result = self._worker.fly(batch)
        self._runs += len(batch.runs)
        return (result,)

    def states(self) -> Sequence[WorkerState]:
        """Returns the state of this process."""
        return (WorkerState("this process", "idle", self._runs),)

    def close(self) -> None:
        """Does nothing: there is no process to end."""
