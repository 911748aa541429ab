"""What a process of a Ray cluster runs: the far end of `ray_worker`."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

from volery.cluster.batches import BatchResult, Preparation, RunBatch, StudyJob
from volery.cluster.errors import StudyError
from volery.cluster.runs import versions


class RunActor:
    """Flies batches of one study; its working folder is a copy of the study's."""

    def __init__(self) -> None:
        self._logs = Path(tempfile.mkdtemp(prefix="logs_", dir=Path.cwd()))  # Ray removes both

    def greet(self) -> Preparation:
        """Returns its version."""
        return Preparation(versions())

    def ping(self) -> None:
        """Answers while another thread flies."""

    def prepare(self, job: StudyJob) -> Preparation:
        """Takes the study over."""
        from volery.cluster.run_worker import started_worker

        here = replace(job, folder=Path.cwd(), results=self._logs)
        self._worker, found = started_worker(here)
        return found

    def fly(self, batch: RunBatch) -> tuple[BatchResult | StudyError, dict[str, bytes]]:
        """Returns the results of a batch, or that the disk is full, and the logs of the runs."""
        from volery.cluster.run_worker import DiskFullError

        assert self._worker is not None
        try:
            result = self._worker.fly(batch)
        except DiskFullError as error:
            return error, {}
        logs = {}
        for path in sorted(self._logs.iterdir()):
            logs[path.name] = path.read_bytes()
            path.unlink()
        return result, logs
