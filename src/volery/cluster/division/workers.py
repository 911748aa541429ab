"""The leader's workers: processes that it starts here, or machines that join it."""

from __future__ import annotations

import os
import queue
import secrets
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from volery.cluster.division.job import DivisionJob, files_of
from volery.cluster.division.leader import Leader, Member, greeting_of
from volery.cluster.division.link import Link, LinkError, RefusedError, admit
from volery.cluster.division.partitioning import check_divisible, divided
from volery.cluster.runs import versions
from volery.core.errors import DivisionError, VoleryError, reason_of
from volery.core.machine import usable_cores
from volery.core.plurals import counted
from volery.engine.engine import Division
from volery.runtime.construction.partition import Partition
from volery.runtime.division_parts import DivisionParts
from volery.scenario.schema import Scenario

_GLANCE_S = 0.2
_START_S = 120.0
"""Wall time within which a worker that was started here must join, s."""
_FAREWELL_S = 5.0
_MAX_TRIES = 3
"""Substitutes for a lost worker that may be lost before they have taken over."""
_MAX_UNPROVEN = 16
"""Connections at a time that have not shown the token."""
_PENALTY_S = 1.0
"""Wall time for which a refused connection counts as one of them, s."""
_THREADS = ("OMP", "OPENBLAS", "MKL", "NUMBA")
TOKEN_VARIABLE = "VOLERY_TOKEN"


@dataclass(frozen=True)
class DivisionOptions:
    """How a run is divided."""

    workers: int
    """Number of workers besides the leader."""
    listen: tuple[str, int] | None = None
    """Host and port at which workers of other machines join; None: they are started here."""
    token: str | None = None
    """What workers must know; None: made up, for workers that are started here."""
    drop: bool = False
    """Whether the run goes on without the nodes and sensors of a lost worker."""
    trust: bool = False
    """Whether nodes from the scenario's folder may run."""


class Workers:
    """Workers of one run. Use it as a context manager.

    show: shows a line to the user. is_stopped: returns whether to stop waiting for workers.
    """

    def __init__(
        self,
        options: DivisionOptions,
        scenario: Scenario,
        show: Callable[[str], None],
        is_stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        self._options, self._scenario, self._show = options, scenario, show
        self._is_stopped = is_stopped
        self._token = options.token or secrets.token_urlsafe(24)
        self._versions = versions()
        host, port = options.listen or ("127.0.0.1", 0)
        self._listener = _listener(host, port)
        self._started: list[_LocalWorker] = []
        self._links: list[Link] = []
        self._members: list[Member] = []
        self._has_begun = False
        self._joined: queue.SimpleQueue[Link] = queue.SimpleQueue()
        """Workers that have joined and have no part yet."""
        self._room = threading.Semaphore(_MAX_UNPROVEN)
        threading.Thread(target=self._listen, name="division", daemon=True).start()

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        self.close(str(error) if isinstance(error, VoleryError) else "the run has ended")

    @property
    def address(self) -> str:
        """Address at which workers join, `HOST:PORT`."""
        host, port = self._listener.getsockname()[:2]
        return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"

    def gather(self) -> Partition:
        """Waits for all workers and hands out their parts; returns the leader's partition.

        Raises `DivisionError` for a scenario that cannot be divided.
        """
        check_divisible(self._scenario)
        if self._options.listen is None:
            self._start()
        else:
            self._await_others()
        parts = divided(self._scenario, self._options.workers + 1)  # may build for minutes
        self._members = [Member(*pair) for pair in zip(self._links, parts[1:], strict=True)]
        for member in self._members:
            self._hand_out(member.link, member.uavs)
        return Partition(named=frozenset().union(*parts[1:]))

    def connect(self, parts: DivisionParts) -> Division:
        """Waits until all workers are ready; returns the connection of the leader to them."""
        for member in self._members:
            member.update(*self._greeting_of(member))
        self._has_begun = True
        return Leader(parts, self._members, self._substitute)

    def close(self, reason: str) -> None:
        """Ends the workers' parts, and the processes that were started here."""
        self._listener.shutdown(socket.SHUT_RDWR)  # ends `accept`
        self._listener.close()
        while self._next_link() is not None:
            continue
        for link in self._links:
            with suppress(DivisionError):  # it has ended already
                link.send("end", reason)
            link.close()
        for member in self._members:
            member.close()
        for worker in self._started:
            worker.close()

    # ------------------------------------------------------------------------------------- inside

    def _start(self) -> None:
        threads = max(1, usable_cores() // (self._options.workers + 1))
        for _ in range(self._options.workers):
            self._start_here(threads)

    def _await_others(self) -> None:
        count = self._options.workers
        self._show(f"waiting for {counted(count, 'worker')}: volery worker --join {self.address}")
        while len(self._links) < count:
            link = self._next_link(_GLANCE_S)
            if link is not None:
                self._show(f"{link.name} has joined")
            if self._is_stopped():
                raise DivisionError("stopped while waiting for workers")

    def _start_here(self, threads: int) -> Link:
        """Starts a worker on this machine and waits until it, or another one, has joined."""
        folder = self._scenario.access.folder or Path()
        trusts = self._options.trust
        worker = _LocalWorker(self.address, self._token, threads, folder, trust=trusts)
        self._started.append(worker)
        until = time.monotonic() + _START_S
        while time.monotonic() < until and not self._is_stopped():
            link = self._next_link(_GLANCE_S)
            if link is not None:
                return link
            if ending := worker.how_it_ended():
                raise DivisionError(f"a worker {ending}")
        raise DivisionError(f"a worker has not joined within {_START_S:.0f} s")

    def _greeting_of(self, member: Member) -> tuple[Sequence[int], dict[str, Any]]:
        """Waits until a worker is ready; another one takes the part of one that cannot start."""
        while True:
            try:
                return greeting_of(member.link)
            except DivisionError as error:
                if self._options.listen is None:
                    raise
                self._show(f"{error}; waiting for another worker")
            link = None
            while link is None:
                if self._is_stopped():
                    raise DivisionError("stopped while waiting for workers")
                link = self._next_link(_GLANCE_S)
            member.link.close()
            member.link = link
            self._hand_out(link, member.uavs)

    def _next_link(self, timeout_s: float = 0.0) -> Link | None:
        """Returns the connection to the worker that has joined first; None: there is none."""
        try:
            link = self._joined.get(timeout=timeout_s) if timeout_s else self._joined.get_nowait()
        except queue.Empty:
            return None
        self._links.append(link)
        link.name = f"worker {len(self._links)}{link.name}"
        return link

    def _listen(self) -> None:
        """Admits workers until the listener is closed."""
        while True:
            try:
                connection, address = self._listener.accept()
            except OSError:
                return
            if self._room.acquire(blocking=False):
                where = "" if self._options.listen is None else f" ({address[0]})"
                threading.Thread(target=self._admit, args=(connection, where), daemon=True).start()
            else:
                connection.close()

    def _admit(self, connection: socket.socket, where: str) -> None:
        link = Link(connection, f"a worker{where}")
        try:
            admit(link, self._token, self._versions)
            link.name = where
            link.show_life()
            self._joined.put(link)
            if self._has_begun and where:
                self._show(f"a worker{where} has joined as a spare")
        except LinkError as error:
            link.close()
            if isinstance(error, RefusedError):
                self._show(str(error))
            time.sleep(_PENALTY_S)  # so that tokens are not tried fast
        finally:
            self._room.release()

    def _hand_out(
        self, link: Link, uavs: frozenset[str], repeated: int = 0, *, is_here: bool = False
    ) -> None:
        """Sends a worker its part; is_here: it was started here, with the scenario's folder."""
        has_folder = is_here or self._options.listen is None
        job = DivisionJob(
            self._scenario.model_dump(exclude_unset=True, mode="json"),
            {} if has_folder else files_of(self._scenario),
            tuple(sorted(uavs)),
            repeated,
        )
        link.send("job", asdict(job))

    def _substitute(self, lost: Member, reason: str) -> Link | None:
        """Has the part of a lost worker repeated here; see `leader.Substitute`."""
        if self._options.drop:
            self._show(f"{reason}; without nodes and sensors from now on: {_listed(lost.uavs)}")
            return None
        start = time.monotonic()
        for _ in range(_MAX_TRIES):
            spare = self._next_link()
            substitute = "this machine" if spare is None else spare.name
            self._show(f"{reason}; {substitute} repeats its part so far and takes it over")
            try:
                link = spare or self._start_here(threads=1)
                self._hand_out(link, lost.uavs, lost.num_answered, is_here=spare is None)
                greeting_of(link)
                for frame in lost.history():
                    link.send_bytes(frame)
            except LinkError as error:
                reason = str(error)
                continue
            took_s = time.monotonic() - start
            self._show(f"{_listed(lost.uavs)}: taken over after {took_s:.1f} s")
            return link
        raise DivisionError(f"{reason}; its part was lost {_MAX_TRIES} times")


class _LocalWorker:
    """A worker process on this machine."""

    def __init__(
        self, address: str, token: str, threads: int, folder: Path, *, trust: bool
    ) -> None:
        single = {f"{name}_NUM_THREADS": str(threads) for name in _THREADS}
        command = [sys.executable, "-P", "-m", "volery", "worker", "--join", address]
        command += [
            "--folder",
            str(folder.resolve()),
            "--quiet",
            "--threads",
            str(threads),
            *(["--trust"] if trust else []),
        ]
        try:
            self._process = subprocess.Popen(
                command,
                env={**os.environ, **single, TOKEN_VARIABLE: token},
                stdin=subprocess.DEVNULL,  # what its nodes print goes to the leader's terminal
                start_new_session=True,  # Ctrl-C is the leader's
            )
        except OSError as error:
            raise DivisionError(f"a worker cannot start: {reason_of(error)}") from None

    def how_it_ended(self) -> str:
        """Returns how the process ended, as text; empty: it runs."""
        code = self._process.poll()
        return "" if code is None else f"ended with exit code {code}"

    def close(self) -> None:
        """Ends the process."""
        try:
            self._process.wait(_FAREWELL_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _listener(host: str, port: int) -> socket.socket:
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listener = socket.create_server((host, port), family=family)
    except (OSError, OverflowError) as error:
        raise DivisionError(
            f"--listen {host}:{port}: {reason_of(error)}; give another port"
        ) from None
    return listener


def _listed(uavs: frozenset[str]) -> str:
    names = sorted(uavs, key=lambda name: (len(name), name))
    return ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
