"""Workers in a Ray cluster: one actor for each of its processors.

Ray carries batches, results and logs, and places the actors; what is missing, retried and stored
remains with the driver, so results are safe on its disk whatever becomes of the cluster. Ray itself
takes minutes to notice a machine that falls silent, so each worker is asked for a sign of life.
"""

from __future__ import annotations

import contextlib
import os
import queue
import socket
import threading
import time
from pathlib import Path
from typing import Any

from volery.cluster.batches import RunBatch, StudyJob
from volery.cluster.errors import StudyError
from volery.cluster.pool_worker import PoolWorker, Replies
from volery.cluster.ray_actor import RunActor
from volery.cluster.results_folder import disk_full
from volery.cluster.worker_pool import WorkerPool
from volery.core.errors import reason_of
from volery.core.extras import import_extra
from volery.core.whole_files import write_whole

_CONNECT_S = 5.0
_LOOK_S = 2.0
"""Time between two looks at a worker that flies."""
_SILENCE_S = 6.0
"""Time without a sign of life after which a worker is lost."""
_FAREWELL_S = 30.0
_MAX_BYTES = 200_000_000
"""Limit of a study's folder, which each machine receives."""
_CODE = ["*.py", "*.pyc", "*.so", "*.pth"]
_LARGE = [".git/", ".venv/", "runs/", "*.mcap", "*.bag", "*.db3"]
_THREADS = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}


def ray_pool(job: StudyJob, address: str, workers: int | None) -> WorkerPool:
    """Joins a Ray cluster and returns an executor on it.

    address: HOST:PORT of its head, or `auto`. workers: their number; None: one for each processor.
    The study's folder is copied to the cluster, without logs and results; without code unless the
    study is trusted. Raises `StudyError` if there is no cluster or it refuses the token.
    """
    ray = import_extra("`volery sweep --ray`", "ray", "ray", "cluster", StudyError)
    _check_reachable(address)
    _check_size(job.folder)
    excluded = [*_LARGE, *([] if job.is_trusted else _CODE)]
    environment = {"working_dir": str(job.folder), "excludes": excluded, "env_vars": _THREADS}
    try:
        ray.init(
            address,
            runtime_env=environment,
            logging_level="ERROR",
            log_to_driver=False,
        )
    except Exception as error:  # Ray raises many kinds
        ray.shutdown()
        raise StudyError(f"--ray {address}: {_first_line(error)}") from None
    count = workers or int(ray.cluster_resources().get("CPU", 0.0))
    if not count:
        ray.shutdown()
        raise StudyError(f"--ray {address}: the cluster has no processor")

    started: list[RayWorker] = []

    def start(number: int, replies: Replies) -> RayWorker:
        started.append(RayWorker(ray, number, job.results, replies))
        return started[-1]

    def leave() -> None:
        for worker in started:
            worker.join()
        ray.shutdown()

    return WorkerPool(job, count, start, close=leave)


def _check_size(folder: Path) -> None:
    """Raises `StudyError` for a folder that is too large to be copied."""
    size = 0
    for parent, folders, names in os.walk(folder):
        folders[:] = [each for each in folders if f"{each}/" not in _LARGE]
        for name in names:
            if f"*{Path(name).suffix}" not in _LARGE:
                with contextlib.suppress(OSError):
                    size += os.lstat(os.path.join(parent, name)).st_size
        if size > _MAX_BYTES:
            raise StudyError(
                f"{folder} holds more than {_MAX_BYTES / 1e6:.0f} MB, too much for each machine "
                "of the cluster: put the study and its files into a folder of its own"
            )


def _check_reachable(address: str) -> None:
    """Raises `StudyError` if nothing listens at an address; Ray would try for minutes."""
    if address == "auto":
        return
    host, colon, port = address.rpartition(":")
    if not (colon and host and port.isdecimal()):
        raise StudyError(f"--ray {address}: give HOST:PORT of the cluster's head, or auto")
    try:
        socket.create_connection((host.strip("[]"), int(port)), _CONNECT_S).close()
    except (OSError, OverflowError) as error:
        raise StudyError(
            f"--ray {address}: no cluster there ({reason_of(error)}); start one: ray start --head"
        ) from None


class RayWorker(PoolWorker):
    """An actor of Ray, which a thread listens to.

    logs: folder of the driver for logs of runs.
    """

    def __init__(self, ray: Any, number: int, logs: Path, replies: Replies) -> None:
        super().__init__(f"worker {number}")
        self._ray, self._logs = ray, logs
        kind = ray.remote(num_cpus=1, concurrency_groups={"signs": 1})(RunActor)
        self._actor = kind.options(scheduling_strategy="SPREAD").remote()
        self._pending: queue.SimpleQueue[Any] = queue.SimpleQueue()
        """Answers in the order of their questions; None: there will be no others."""
        self._pending.put(self._actor.greet.remote())
        self._listener = threading.Thread(target=self._listen, args=(replies,), daemon=True)
        self._listener.start()

    def join(self) -> None:
        """Waits for the end of its thread: Ray crashes if it shuts down while a thread uses it."""
        self._listener.join(_FAREWELL_S)

    def send_job(self, job: StudyJob) -> None:
        """Hands over the study."""
        self._pending.put(self._actor.prepare.remote(job))

    def end(self, reason: str) -> None:
        """Kills the actor; its listener reports that."""
        self.ending = reason
        self._kill()

    def how_it_ended(self) -> str:
        """Returns how it ended, as text."""
        return self.ending

    def close(self) -> None:
        """Kills the actor."""
        self._pending.put(None)
        self._kill()

    def _send_batch(self, batch: RunBatch) -> None:
        self._pending.put(self._actor.fly.remote(batch))

    def _kill(self) -> None:
        with contextlib.suppress(Exception):  # the cluster may have gone
            self._ray.kill(self._actor)

    def _listen(self, replies: Replies) -> None:
        """Passes answers on until the actor has ended."""
        has_begun = False
        while (answer := self._pending.get()) is not None:
            try:
                message = self._awaited(answer, is_watched=has_begun)
            except Exception as error:  # of an actor, a machine or the cluster that was lost
                self.ending = self.ending or f"was lost: {_first_line(error)}"
                self._kill()
                replies.put((self, None))
                return
            has_begun = True
            replies.put((self, self._stored(*message) if type(message) is tuple else message))

    def _awaited(self, answer: Any, *, is_watched: bool) -> Any:
        """Returns an answer. Raises if the actor ends, or is silent for too long."""
        while not self._ray.wait([answer], timeout=_LOOK_S)[0]:
            if is_watched:
                self._check_alive()
        return self._ray.get(answer)

    def _check_alive(self) -> None:
        sign = self._actor.ping.options(concurrency_group="signs").remote()
        start = time.monotonic()
        if not self._ray.wait([sign], timeout=_SILENCE_S)[0]:
            raise TimeoutError(f"no sign of life for {time.monotonic() - start:.0f} s")
        self._ray.get(sign)

    def _stored(self, message: Any, logs: dict[str, bytes]) -> Any:
        """Writes logs of a batch; returns its message, or that the disk is full."""
        try:
            for name, content in logs.items():
                write_whole(self._logs / name, content)
        except OSError:
            return StudyError(disk_full(self._logs))
        return message


def _first_line(error: BaseException) -> str:
    return str(error).strip().partition("\n")[0] or type(error).__name__
