"""Measures every peer beside Volery, in turns, on one core."""

from __future__ import annotations

import logging
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

from volery_benchmarks.peers.catalogue import PEERS, Contest, HoverContest, Peer
from volery_benchmarks.peers.environments import environment
from volery_benchmarks.peers.failure import PeerError
from volery_benchmarks.peers.peer_process import PeerProcess
from volery_benchmarks.peers.task import Task
from volery_benchmarks.registry import Measured

_SCRIPTS = Path(__file__).parent
_LOG = logging.getLogger(__name__)
_FEWEST_ROUNDS, _MAX_ROUNDS = 5, 40
_SECONDS = 15.0
"""Time of repeated rounds for each contest, s."""


def prepare(contest: Contest, folder: Path) -> Task:
    """Prepares a contest; writes the peer's files into `folder`."""
    if isinstance(contest, HoverContest):
        from volery_benchmarks.peers.hover import hover_task

        return hover_task(contest)
    from volery_benchmarks.peers.rays import ray_task

    return ray_task(contest, folder)


def measure_peers(
    peers: Sequence[Peer] = PEERS,
    *,
    environment: Callable[[Peer], Path] = environment,
    prepare: Callable[[Contest, Path], Task] = prepare,
    scripts: Path = _SCRIPTS,
    seconds: float = _SECONDS,
) -> Measured:
    """Returns the figures of all contests; Volery takes part in each, with or without a peer.

    Errors of a peer are listed in `failures` under its name, or that of the contest.
    """
    figures: dict[str, float] = {}
    failures: dict[str, str] = {}
    versions: dict[str, str] = {}
    for peer in peers:
        _LOG.info("%s: making its environment (%s)", peer.name, ", ".join(peer.requirements))
        python = None
        try:
            python = environment(peer)
        except PeerError as failure:
            _LOG.info("%s: %s", peer.name, failure)
            failures[peer.name] = str(failure)
        for contest in peer.contests:
            _LOG.info("%s: %s", peer.name, contest)
            script = scripts / peer.script
            with tempfile.TemporaryDirectory() as folder, _one_core():
                task = prepare(contest, Path(folder))
                with closing(task):
                    match = _Match(peer, contest, task, seconds)
                    measured = match.play(python, script, Path(folder))
            figures.update(measured.figures)
            failures.update(measured.failures)
            versions.update(measured.versions)
    return Measured(figures, failures, versions)


class _Match:
    """Measures one contest of one peer and Volery."""

    def __init__(self, peer: Peer, contest: Contest, task: Task, seconds: float) -> None:
        self._peer, self._contest, self._task = peer, contest, task
        self._seconds = seconds

    def play(self, python: Path | None, script: Path, folder: Path) -> Measured:
        """Measures in turns with the peer; Volery alone if there is none, or if it fails."""
        failures = {}
        if python is not None:
            request = {**self._task.request, "packages": self._peer.packages}
            try:
                with PeerProcess(python, script, request, folder) as peer:
                    return self._beside(peer)
            except PeerError as failure:
                name = f"{self._peer.name}_{self._contest.case}"
                _LOG.info("%s: %s", name, failure)
                failures[name] = str(failure)
        (ours,) = _medians([self._ours], self._seconds)
        self._task.check(None)
        return Measured(self._figures("ours_", self._task.amount / ours), failures)

    def _beside(self, peer: PeerProcess) -> Measured:
        versions = peer.versions()
        ours, theirs = _medians([self._ours, peer.round], self._seconds)
        further = self._task.check(peer.facts())
        our_speed, speed = self._task.amount / ours, self._task.peer_amount / theirs
        figures = {**self._figures("ours_", our_speed), **self._figures("", speed)}
        figures[self._name("ratio")] = our_speed / speed
        figures.update((self._name(what), value) for what, value in further.items())
        peer_versions = ", ".join(f"{name} {version}" for name, version in versions.items())
        return Measured(figures, {}, {self._peer.name: peer_versions})

    def _ours(self) -> float:
        start = time.perf_counter()
        self._task.ours()
        return time.perf_counter() - start

    def _figures(self, prefix: str, per_s: float) -> dict[str, float]:
        figures = {self._name(f"{prefix}{self._contest.unit}_per_s"): per_s}
        if self._task.simulated_per_s is not None:
            factor = per_s / self._task.simulated_per_s
            figures[self._name(f"{prefix}real_time_factor")] = factor
        return figures

    def _name(self, what: str) -> str:
        return self._peer.figure(self._contest, what)


def _medians(rounds: Sequence[Callable[[], float]], seconds: float) -> list[float]:
    """Returns the median of the returned times of each, s; in turns, after a warm-up round."""
    taken: list[list[float]] = [[] for _ in rounds]
    for each in rounds:
        each()
    end = time.perf_counter() + seconds
    for number in range(_MAX_ROUNDS):
        if number >= _FEWEST_ROUNDS and time.perf_counter() > end:
            break
        for each, values in zip(rounds, taken, strict=True):
            values.append(each())
    return [statistics.median(values) for values in taken]


@contextmanager
def _one_core() -> Iterator[None]:
    """Pins the calling thread, and processes that it starts, to one core."""
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(cores)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)
