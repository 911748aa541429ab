"""Measures coverage planning: DARP's published reference cases, beside an open implementation.

Volery is always measured, the peer if VOLERY_COVERAGE_PEER names a folder with its modules: that of
github.com/alice-st/DARP (Python), whose own tests contain these four cases. It runs in its own
process, with the interpreter that VOLERY_COVERAGE_PEER_PYTHON names (it needs numpy, numba, cv2,
pygame, scikit-learn and PIL), in turns with Volery. Both divide the map and plan all tours.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.coverage.plan import plan_coverage
from volery_benchmarks.peers.failure import PeerError
from volery_benchmarks.peers.peer_process import PeerProcess
from volery_benchmarks.registry import Measured

_ROUNDS = 5
_SCRIPT = Path(__file__).parent / "peers" / "darp_plans.py"
_FIRST_PLAN = """
import time
from volery_benchmarks import coverage
case = coverage.CASES[1]
begin = time.perf_counter()
coverage.plan(case)
print(time.perf_counter() - begin)
"""


@dataclass(frozen=True)
class Case:
    """Describes a square map: cells in which UAVs start, blocked cells; numbered row by row."""

    name: str
    side: int
    starts: tuple[int, ...]
    blocked: tuple[int, ...] = ()

    def free(self) -> NDArray[np.bool_]:
        """Returns the free cells (side, side)."""
        free = np.ones(self.side * self.side, np.bool_)
        free[list(self.blocked)] = False
        return free.reshape(self.side, self.side)

    def start_cells(self) -> list[tuple[int, int]]:
        """Returns row and column of each UAV."""
        return [divmod(start, self.side) for start in self.starts]


CASES = (
    Case("10x10_3_uavs", 10, (1, 3, 9)),
    Case("20x20_4_uavs", 20, (1, 50, 76, 83), (3, 4, 5, 6, 7, 8, 99, 100, 101, 102)),
    Case("50x50_4_uavs_in_a_corner", 50, (1, 2, 3, 4)),
    Case("50x50_5_uavs", 50, (500, 624, 1500, 2159, 2), tuple(range(2490, 2500))),
)


def plan(case: Case) -> None:
    """Plans a case with Volery."""
    plan_coverage(case.free(), case.start_cells())


def measure() -> Measured:
    """Returns medians in ms; `*_share_of_peer` is Volery's time divided by the peer's."""
    figures: dict[str, float] = {"first_plan_of_a_process_ms": 1e3 * _first_plan()}
    failures: dict[str, str] = {}
    versions: dict[str, str] = {}
    folder = os.environ.get("VOLERY_COVERAGE_PEER")
    if folder is None:
        failures["peer"] = "VOLERY_COVERAGE_PEER names no folder with an implementation of DARP"
    for case in CASES:
        try:
            if folder is not None:
                figures.update(_beside(case, Path(folder), versions))
                continue
        except PeerError as failure:
            failures[case.name] = str(failure)
        (ours,) = _medians([lambda case=case: _timed(case)])  # type: ignore[misc]
        figures[f"{case.name}_ms"] = 1e3 * ours
    return Measured(figures, failures, versions)


def _beside(case: Case, peer: Path, versions: dict[str, str]) -> dict[str, float]:
    """Returns the figures of one case with the peer's."""
    python = Path(os.environ.get("VOLERY_COVERAGE_PEER_PYTHON", sys.executable))
    request = {
        "folder": str(peer),
        "packages": ["numpy", "numba"],
        "side": case.side,
        "starts": case.starts,
        "blocked": case.blocked,
    }
    with (
        tempfile.TemporaryDirectory() as folder,
        PeerProcess(python, _SCRIPT, request, Path(folder)) as process,
    ):
        peer_versions = ", ".join(f"{k} {v}" for k, v in process.versions().items())
        ours, theirs = _medians([lambda: _timed(case), process.round])
        facts = process.facts()
    versions["peer"] = peer_versions
    if sum(facts["sub_cells"]) != 4 * int(case.free().sum()):
        raise PeerError(f"its tours have {facts['sub_cells']} sub-cells, which is not all of them")
    return {
        f"{case.name}_ms": 1e3 * ours,
        f"{case.name}_peer_ms": 1e3 * theirs,
        f"{case.name}_share_of_peer": ours / theirs,
    }


def _medians(rounds: list[Callable[[], float]]) -> list[float]:
    """Returns the median time of each, s, in turns, after a warm-up round."""
    for each in rounds:
        each()
    taken = [[each() for each in rounds] for _ in range(_ROUNDS)]
    return [statistics.median(values) for values in zip(*taken, strict=True)]


def _timed(case: Case) -> float:
    begin = time.perf_counter()
    plan(case)
    return time.perf_counter() - begin


def _first_plan() -> float:
    """Returns the time of a new process's first plan, s, with all kernels cached on disk."""
    plan(CASES[1])
    completed = subprocess.run(
        [sys.executable, "-P", "-c", _FIRST_PLAN], capture_output=True, text=True, check=True
    )
    return float(completed.stdout)
