"""The contract of executors: what flies batches of runs for a driver.

`worker_pool.WorkerPool` has workers on this machine (`process_worker`) or in a Ray cluster
(`ray_worker`), `inline_executor` none; `batches` holds the plain data that they carry, and
`run_worker.RunWorker` flies them at the other end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from volery.cluster.batches import BatchResult, Preparation, RunBatch


@dataclass(frozen=True)
class BatchLoss:
    """A batch whose worker has ended; the runs that were not flown may be submitted again."""

    batch: RunBatch
    """The batch."""
    reason: str
    """How the worker ended, as text: `was killed by signal 9`."""


@dataclass(frozen=True)
class WorkerState:
    """What a worker does now, for displays."""

    name: str
    """Name of the worker."""
    state: str
    """`starting`, `idle`, `busy` or `ended`."""
    runs: int
    """Runs that it has finished."""
    batch: int = 0
    """Runs of its present batch."""


class Executor(Protocol):
    """Flies batches of one study's runs; submitting and collecting never raise for lost workers."""

    @property
    def num_workers(self) -> int:
        """Number of workers that fly at the same time."""

    def prepare(self) -> Preparation:
        """Starts the workers and returns what the first one found out.

        Raises `StudyError` for a worker that cannot start, or that has another version.
        """

    def can_submit(self) -> bool:
        """Returns whether a worker has nothing to do, or little."""

    def submit(self, batch: RunBatch) -> None:
        """Hands a batch to a worker; call it only if `can_submit()`."""

    def collect(self, timeout_s: float) -> Sequence[BatchResult | BatchLoss]:
        """Returns what has ended since the last call; waits for the first by `timeout_s` at most.

        Raises `StudyError` if a worker reports that the disk is full.
        """

    def states(self) -> Sequence[WorkerState]:
        """Returns the state of each worker."""

    def close(self) -> None:
        """Ends all workers; unfinished batches are dropped."""
