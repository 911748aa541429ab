"""Measures studies of many runs: rate, overhead beside a bare loop, interrupted studies.

The study flies `hover` for 5 s with other seeds. Rates are runs per second of CPU time, summed over
the driver and its worker, so that they do not depend on what else the machine does. The bare loop
flies the same runs in the same way, in one process, and keeps nothing; it runs before and after the
study. The start of the processes, measured with a study of one run, is a figure of its own.
"""

from __future__ import annotations

import logging
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from volery.cluster import load_study
from volery.cluster.results_folder import ResultsFolder
from volery.cluster.study_runs import stored_plan, table_of

_LOG = logging.getLogger(__name__)
_RUNS, _QUICK_RUNS = 1000, 100
_KILLED_RUNS, _QUICK_KILLED_RUNS, _KILLS = 2000, 60, 5
_STUDY = """name = "bench"
scenario = "hover"
duration_s = 5.0
repetitions = {runs}
vectorized = {vectorized}
metrics = ["success", "collisions", "distance_m", "time_s"]
"""
_LOOP = """
import sys
from volery.cluster.batches import RunBatch, StudyJob
from volery.cluster.loading import load_study
from volery.cluster.run_worker import RunWorker
from volery.cluster.runs import runs_of

loaded = load_study(sys.argv[1])
worker = RunWorker(StudyJob(
    loaded.study, loaded.where, loaded.folder, False, loaded.points[0], loaded.folder
))
for run in runs_of(loaded):
    worker.fly(RunBatch(0, (run,)))
"""


def measure(*, quick: bool = False) -> dict[str, float]:
    """Returns the figures of the bench."""
    runs = _QUICK_RUNS if quick else _RUNS
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        first = _study(work, "first", 1, vectorized=False)
        for study in (first, _study(work, "compiled", 2, vectorized=True)):
            _sweep(study, work)
        alone = _study(work, "alone", runs, vectorized=False)
        loop_start_s, start_s = _loop(first), _sweep(first, work, "first_again")
        before_s = _loop(alone)
        alone_s = _sweep(alone, work) - start_s
        together_s = _sweep(_study(work, "together", runs, vectorized=True), work) - start_s
        loop_s = (before_s + _loop(alone)) / 2.0 - loop_start_s
        return {
            "sweep_runs_per_s_core": (runs - 1) / alone_s,
            "sweep_runs_per_s_core_vectorized": (runs - 1) / together_s,
            "sweep_overhead": alone_s / loop_s - 1.0,
            "bare_loop_runs_per_s_core": (runs - 1) / loop_s,
            "start_cpu_s": start_s,
            "bare_loop_start_cpu_s": loop_start_s,
            **_killed(work, _QUICK_KILLED_RUNS if quick else _KILLED_RUNS),
            "load_average": os.getloadavg()[0],
        }


def _study(work: Path, name: str, runs: int, *, vectorized: bool) -> Path:
    path = work / f"{name}.toml"
    path.write_text(_STUDY.format(runs=runs, vectorized=str(vectorized).lower()), encoding="utf-8")
    return path


def _command(study: Path, out: Path) -> list[str]:
    words = ["sweep", str(study), "--out", str(out), "--workers", "1"]
    return [sys.executable, "-P", "-m", "volery", *words]


def _sweep(study: Path, work: Path, folder: str | None = None) -> float:
    """Flies a study with one worker and returns the CPU time of all its processes, s."""
    return _cpu_s(_command(study, work / (folder or study.stem)), f"sweep of {study.stem}")


def _loop(study: Path) -> float:
    """Flies the runs of a study in a loop and returns the CPU time, s."""
    return _cpu_s([sys.executable, "-P", "-c", _LOOP, str(study)], f"loop over {study.stem}")


def _cpu_s(command: Sequence[str], what: str) -> float:
    """Runs a command and returns the CPU time of it and its children, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    _LOG.info("%s: %.2f s of CPU time", what, cpu_s)
    return cpu_s


def _killed(work: Path, runs: int) -> dict[str, float]:
    """Returns whether a study killed at random times equals an uninterrupted one, 1 or 0."""
    cut = _study(work, "cut", runs, vectorized=False)
    draws = random.Random(27)
    goals = sorted(draws.uniform(0.05, 0.95) * runs for _ in range(_KILLS))
    for goal in goals:
        _kill_at(cut, work, goal)
    before = _finished(work / "cut")
    _sweep(cut, work)
    whole = _study(work, "whole", runs, vectorized=False)
    _sweep(whole, work)
    tables = []
    for study in (cut, whole):
        loaded, folder = load_study(study), work / study.stem
        plan = stored_plan(loaded, folder)
        tables.append(table_of(loaded, plan, ResultsFolder(folder)))
    is_equal = tables[0].repeatable == tables[1].repeatable and len(tables[0]) == runs
    return {"killed_and_resumed": float(is_equal), "runs_before_the_last_kill": float(before)}


def _kill_at(study: Path, work: Path, goal: float) -> None:
    """Starts a study and kills its driver when a number of results exist."""
    command = _command(study, work / study.stem)
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as driver:
        while _finished(work / study.stem) < goal and driver.poll() is None:
            time.sleep(0.02)
        driver.send_signal(signal.SIGKILL)
    _LOG.info("killed with %d results", _finished(work / study.stem))


def _finished(folder: Path) -> int:
    return sum(1 for _ in folder.glob("runs/*/*.json"))
