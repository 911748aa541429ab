"""Measures how fast Volery starts: the import, the main job's first LIDAR scan, its memory.

Each figure comes from separate processes: one with an empty cache of compiled kernels, some with a
filled cache, one that runs the main job with log and report.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

_WARM_REPEATS = 5
_IMPORT_REPEATS = 15
_IMPORT = """
import time
start = time.perf_counter()
import volery
print(1e3 * (time.perf_counter() - start))
"""
_FIRST_FRAME = """
import volery
simulation = volery.Simulation(volery.load_scenario("forest_survey"))
scans = []
simulation.graph.subscribe("/uav1/laser/horizontal/scan", scans.append)
while not scans:
    simulation.step(5)
"""


def measure() -> dict[str, float]:
    """Returns the figures of the bench `start`."""
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder) / "cache"
        cold = _first_frame_s(cache)
        warm = statistics.median(_first_frame_s(cache) for _ in range(_WARM_REPEATS))
        wall, peak_mb = _main_job(Path(folder), cache)
    return {
        "import_ms": statistics.median(_import_ms() for _ in range(_IMPORT_REPEATS)),
        "first_frame_s_cold": cold,
        "first_frame_s_warm": warm,
        "peak_mb_main_job": peak_mb,
        "main_job_wall_s": wall,
    }


def _import_ms() -> float:
    command = [sys.executable, "-P", "-c", _IMPORT]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def _first_frame_s(cache: Path) -> float:
    before = time.perf_counter()
    subprocess.run([sys.executable, "-P", "-c", _FIRST_FRAME], check=True, env=_environment(cache))
    return time.perf_counter() - before


def _main_job(folder: Path, cache: Path) -> tuple[float, float]:
    """Returns wall time, s, and peak resident memory (MB, 1e6 bytes) of the main job's process."""
    command = [sys.executable, "-P", "-m", "volery", "run", "forest_survey"]
    command += ["--record", str(folder / "flight.mcap"), "--report", str(folder / "report")]
    before = time.perf_counter()
    process = subprocess.Popen(command, env=_environment(cache), stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise RuntimeError(f"the main job ended with status {status}")
    return time.perf_counter() - before, usage.ru_maxrss * 1024 / 1e6


def _environment(cache: Path) -> dict[str, str]:
    return {**os.environ, "VOLERY_CACHE_DIR": str(cache)}
