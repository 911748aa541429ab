"""The thread that writes to ROS 2, so that neither engine nor other bridges wait for it."""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Callable

_log = logging.getLogger(__name__)

Job = Callable[[], object]


class Ros2WriterThread:
    """Runs jobs one after the other."""

    def __init__(self, name: str = "volery-ros2") -> None:
        self._jobs: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def post(self, job: Job) -> None:
        """Adds a job; any thread may call it without waiting."""
        self._jobs.put(job)

    def close(self) -> None:
        """Runs the jobs so far, then ends."""
        self._jobs.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            try:
                job()
            except Exception as error:  # an error of one topic must not end the others
                _log.warning("ROS 2: %s: %s", type(error).__name__, error)
