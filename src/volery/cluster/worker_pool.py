"""Flies batches by workers that each serve all runs of a study: processes here, or Ray's actors."""

from __future__ import annotations

import queue
import time
from collections import deque
from collections.abc import Callable, Sequence

from volery.cluster.batches import BatchResult, Preparation, RunBatch, StudyJob
from volery.cluster.errors import StudyError
from volery.cluster.executor import BatchLoss, WorkerState
from volery.cluster.pool_worker import PoolWorker, Replies
from volery.cluster.runs import difference, versions

_AHEAD = 2
"""Batches of a worker: the next one waits, so that the worker does not."""
_LOOK_S = 0.5
_MAX_LOST_STARTS = 3
"""Workers that may end in a row before their first run, while others fly."""
TIMED_OUT = "exceeded the timeout"
"""Beginning of the reason of a loss by a timeout."""


class WorkerPool:
    """An executor of workers; see `Executor`. A worker that ends is replaced.

    workers: their number. start: starts a worker by its number, whose messages go to the queue.
    close: called when all workers have ended.
    """

    def __init__(
        self,
        job: StudyJob,
        workers: int,
        start: Callable[[int, Replies], PoolWorker],
        close: Callable[[], None] = lambda: None,
    ) -> None:
        self._job = job
        self._count = workers
        self._make = start
        self._timeout_s = job.study.run_timeout_s
        self._close = close
        self._replies: Replies = queue.SimpleQueue()
        self._workers: list[PoolWorker] = []
        self._waiting: deque[RunBatch] = deque()
        """Batches of ended workers that had not begun."""
        self._started = 0
        self._lost_starts = 0

    @property
    def num_workers(self) -> int:
        """Number of workers."""
        return self._count

    def prepare(self) -> Preparation:
        """Starts the workers; the first one compiles for all of them.

        Raises `StudyError` if no run can start, or a worker has another version of Volery.
        """
        self._workers = [self._start() for _ in range(self._count)]
        first = self._workers[0]
        first.send_job(self._job)
        found: Preparation | None = None
        while found is None:
            found = self._prepared(*self._replies.get())
        for worker in self._workers[1:]:
            worker.send_job(self._job)
        return found

    def can_submit(self) -> bool:
        """Returns whether a worker has room for a batch."""
        return not self._waiting and any(self._has_room(worker) for worker in self._workers)

    def submit(self, batch: RunBatch) -> None:
        """Hands a batch to the worker with the least to do."""
        ready = [worker for worker in self._workers if self._has_room(worker)]
        min(ready, key=lambda worker: len(worker.batches)).send(batch)

    def collect(self, timeout_s: float) -> Sequence[BatchResult | BatchLoss]:
        """Returns results and losses since the last call; waits for the first by `timeout_s`."""
        found: list[BatchResult | BatchLoss] = []
        until = time.monotonic() + timeout_s
        while not found:
            left_s = until - time.monotonic()
            try:
                found += self._taken(*self._replies.get(timeout=max(0.0, min(left_s, _LOOK_S))))
            except queue.Empty:
                self._end_late_workers()
                if left_s <= 0.0:
                    return ()
        while True:
            try:
                found += self._taken(*self._replies.get_nowait())
            except queue.Empty:
                return found

    def states(self) -> Sequence[WorkerState]:
        """Returns the state of each worker."""
        return [worker.state() for worker in self._workers]

    def close(self) -> None:
        """Ends all workers; unfinished batches are dropped."""
        workers, self._workers = self._workers, []
        for worker in workers:
            worker.close()
        self._close()

    # ------------------------------------------------------------------------------------- inside

    def _has_room(self, worker: PoolWorker) -> bool:
        return worker.is_ready and not worker.ending and len(worker.batches) < _AHEAD

    def _start(self) -> PoolWorker:
        self._started += 1
        return self._make(self._started, self._replies)

    def _prepared(self, worker: PoolWorker, message: object) -> Preparation | None:
        """Takes a message of a worker that is not ready; returns what it found out, or None."""
        if worker not in self._workers:
            return None
        if not isinstance(message, Preparation):
            raise StudyError(f"{worker.name} {worker.how_it_ended()} before its first run")
        if differs := difference(versions(), message.versions):
            raise StudyError(f"{worker.name} has {differs}: install the same everywhere")
        if not worker.has_greeted:
            worker.has_greeted = True
            return None
        if message.error:
            raise StudyError(f"{self._job.where}: {message.error}")
        worker.is_ready = True
        self._lost_starts = 0
        return message

    def _taken(self, worker: PoolWorker, message: object) -> list[BatchResult | BatchLoss]:
        """Takes a message of a worker, or its end."""
        if worker not in self._workers:
            return []
        if isinstance(message, StudyError):
            raise message
        if isinstance(message, BatchResult):
            worker.finished()
            self._pass_on()
            return [message]
        if not worker.is_ready:
            if message is None and self._may_lose():
                return self._replaced(worker)
            self._prepared(worker, message)
            self._pass_on()
            return []
        return self._replaced(worker)

    def _may_lose(self) -> bool:
        """Returns whether a worker that ends before its first run is replaced."""
        self._lost_starts += 1
        is_flying = any(worker.is_ready for worker in self._workers)
        return is_flying and self._lost_starts <= _MAX_LOST_STARTS

    def _replaced(self, worker: PoolWorker) -> list[BatchResult | BatchLoss]:
        """Replaces a worker that has ended; returns the loss of the batch that it was flying."""
        reason = worker.how_it_ended()
        worker.close()
        batches = list(worker.batches)
        self._waiting.extend(batches[1:])
        fresh = self._start()
        fresh.send_job(self._job)
        self._workers[self._workers.index(worker)] = fresh
        return [BatchLoss(batches[0], reason)] if batches else []

    def _pass_on(self) -> None:
        while self._waiting and any(self._has_room(worker) for worker in self._workers):
            self.submit(self._waiting.popleft())

    def _end_late_workers(self) -> None:
        if self._timeout_s is None:
            return
        for worker in self._workers:
            if worker.batches and not worker.ending:
                allowed_s = self._timeout_s * len(worker.batches[0].runs)
                if worker.busy_s > allowed_s:
                    worker.end(f"{TIMED_OUT} of {self._timeout_s:g} s")
