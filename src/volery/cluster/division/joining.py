"""`volery worker`: joins the leader of a divided run and serves its part to the end."""

from __future__ import annotations

import socket
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from volery.cluster.division.job import DivisionJob
from volery.cluster.division.link import Link, apply_to
from volery.cluster.division.worker import RunEndedError, Worker
from volery.cluster.runs import versions
from volery.core.errors import DivisionError, VoleryError, reason_of
from volery.core.plurals import counted
from volery.runtime.division_parts import DivisionParts
from volery.runtime.simulation import Simulation
from volery.scenario.schema import Scenario

_RETRY_S = 0.5


def serve_leader(
    address: tuple[str, int],
    token: str,
    *,
    threads: int,
    trust: bool,
    folder: Path | None,
    wait_s: float,
    show: Callable[[str], None],
) -> str:
    """Joins the leader at `address` and serves it; returns why the run ended.

    trust: whether code that the leader names may run from this machine's working folder. folder:
    that of the scenario, if this machine has it. wait_s: wall time within which the leader must
    listen. Raises `DivisionError` if it refuses this worker or is lost, any `VoleryError` that ends
    this part of the run.
    """
    link = Link(_connected(address, wait_s, show), "the leader")
    try:
        apply_to(link, token, versions())
        link.show_life()
        show(f"has joined {address[0]}:{address[1]}")
        kind, *rest = link.receive()
        if kind == "end":
            return str(rest[0])
        if kind != "job":
            raise DivisionError("the leader sends no part of a run")
        job = DivisionJob(**rest[0])
        show(f"serves {counted(len(job.uavs), 'UAV')}")
        with tempfile.TemporaryDirectory(prefix="volery_") as target:
            scenario = partial(job.scenario, Path(target), trust=trust, folder=folder)
            try:
                return _flown(job, scenario, link, threads)
            except RunEndedError as error:
                return str(error)
            except Exception as error:
                _report(link, error)
                raise
    finally:
        link.close()


def _flown(job: DivisionJob, scenario: Callable[[], Scenario], link: Link, threads: int) -> str:
    with Simulation(scenario(), threads=threads, partition=job.partition) as simulation:

        def connect(parts: DivisionParts) -> Worker:
            worker = Worker(parts, link, job.repeated)
            worker.greet()
            return worker

        simulation.divide(connect)
        simulation.follow()
    return "the run has ended"


def _connected(
    address: tuple[str, int], wait_s: float, show: Callable[[str], None]
) -> socket.socket:
    until, shown = time.monotonic() + wait_s, False
    while True:
        try:
            return socket.create_connection(address, 5.0)
        except (OSError, OverflowError) as error:
            if time.monotonic() >= until:
                raise DivisionError(
                    f"--join {address[0]}:{address[1]}: no leader there ({reason_of(error)}); "
                    "start it: volery run SCENARIO --workers N --listen HOST:PORT"
                ) from None
            if not shown:
                show(f"waits up to {wait_s:.0f} s for a leader at {address[0]}:{address[1]}")
            shown = True
            time.sleep(_RETRY_S)


def _report(link: Link, error: Exception) -> None:
    """Sends the leader the reason why this part of the run has failed."""
    text = str(error) if isinstance(error, VoleryError) else f"{type(error).__name__}: {error}"
    try:
        link.send("failed", text, list(getattr(error, "__notes__", ())))
    except DivisionError:
        return  # the leader is lost
