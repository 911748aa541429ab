"""One worker of a pool, whatever carries its messages."""

from __future__ import annotations

import queue
import time
from abc import ABC, abstractmethod
from collections import deque
from typing import Any

from volery.cluster.batches import RunBatch, StudyJob
from volery.cluster.executor import WorkerState

Reply = tuple["PoolWorker", Any]
"""A worker and its message; None: it has ended."""
Replies = queue.SimpleQueue[Reply]


class PoolWorker(ABC):
    """A worker that has started; its messages arrive in the queue that it was given.

    First comes a `Preparation` with its version, then one that answers `send_job`, then a
    `BatchResult` for each batch. Sending never raises for a worker that has ended.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.batches: deque[RunBatch] = deque()
        """Batches that it has, the present one first."""
        self.has_greeted = False
        """Whether it has said which version it has."""
        self.is_ready = False
        """Whether it has prepared."""
        self.ending = ""
        """Why the pool ends it; empty: it does not."""
        self._runs = 0
        self._began = time.monotonic()

    @property
    def busy_s(self) -> float:
        """Wall time since its present batch began, s; 0 without one."""
        return time.monotonic() - self._began if self.batches else 0.0

    def send(self, batch: RunBatch) -> None:
        """Hands over a batch."""
        if not self.batches:
            self._began = time.monotonic()
        self.batches.append(batch)
        self._send_batch(batch)

    def finished(self) -> RunBatch:
        """Removes and returns the present batch, which has ended."""
        batch = self.batches.popleft()
        self._runs += len(batch.runs)
        self._began = time.monotonic()
        return batch

    def state(self) -> WorkerState:
        """Returns its state for displays."""
        word = "busy" if self.batches else "idle" if self.is_ready else "starting"
        runs = len(self.batches[0].runs) if self.batches else 0
        return WorkerState(self.name, word, self._runs, runs)

    @abstractmethod
    def send_job(self, job: StudyJob) -> None:
        """Hands over the study."""

    @abstractmethod
    def end(self, reason: str) -> None:
        """Ends it at once; None arrives soon."""

    @abstractmethod
    def how_it_ended(self) -> str:
        """Returns how it ended, as text."""

    @abstractmethod
    def close(self) -> None:
        """Ends it and frees what it holds."""

    @abstractmethod
    def _send_batch(self, batch: RunBatch) -> None:
        """Sends a batch."""
