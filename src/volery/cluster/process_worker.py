"""A worker that is a process of this machine: `worker_process`."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

from volery.cluster.batches import RunBatch, StudyJob
from volery.cluster.errors import StudyError
from volery.cluster.pool_worker import PoolWorker, Replies
from volery.cluster.worker_messages import read_message, write_message
from volery.core.errors import reason_of
from volery.core.whole_files import open_new

_THREADS = ("OMP", "OPENBLAS", "MKL", "NUMBA")
_LOG_LINES = 3
_FAREWELL_S = 2.0


class ProcessWorker(PoolWorker):
    """Starts a process; its messages go to `replies` from a thread of its own.

    log: file for its standard error. Raises `StudyError` if the process cannot start.
    """

    def __init__(self, number: int, log: Path, replies: Replies) -> None:
        super().__init__(f"worker {number}")
        self._log_path = log
        threads = {f"{name}_NUM_THREADS": "1" for name in _THREADS}
        try:
            with open_new(log) as errors:
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "volery.cluster.worker_process"],
                    env={**os.environ, **threads},
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=errors,
                    start_new_session=True,  # Ctrl-C is the driver's
                )
        except OSError as error:
            raise StudyError(f"a worker cannot start: {reason_of(error)}") from None
        threading.Thread(target=self._listen, args=(replies,), daemon=True).start()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def send_job(self, job: StudyJob) -> None:
        """Hands over the study."""
        self._send(job)

    def end(self, reason: str) -> None:
        """Kills the process; its output ends soon."""
        self.ending = reason
        self._process.kill()

    def how_it_ended(self) -> str:
        """Waits for the end of the process and returns how it ended, as text."""
        try:
            code = self._process.wait(_FAREWELL_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        if self.ending:
            return self.ending
        if code < 0:
            return f"was killed by signal {-code} ({signal.Signals(-code).name})"
        return f"ended with exit code {code}{self._last_words()}"

    def close(self) -> None:
        """Ends the process and waits for it."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                try:
                    pipe.close()
                except OSError:
                    continue  # what was not flushed has no reader

    def _send_batch(self, batch: RunBatch) -> None:
        self._send(batch)

    def _send(self, message: object) -> None:
        if self._process.stdin is not None:
            try:
                write_message(self._process.stdin, message)
            except OSError:
                return  # it has ended: its listener reports that

    def _listen(self, replies: Replies) -> None:
        output = self._process.stdout
        try:
            while output is not None:
                replies.put((self, read_message(output)))
        except (EOFError, OSError, ValueError):
            replies.put((self, None))

    def _last_words(self) -> str:
        try:
            lines = self._log_path.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            return ""
        return f": {' | '.join(lines[-_LOG_LINES:])}" if lines else ""
