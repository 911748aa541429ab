"""Results do not depend on the order in which kernels were compiled into the cache."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

_COMPILE_BACKWARDS = """
import sys
sys.modules["scipy"] = None  # numba would use it for linear algebra; users need not have it
from volery import load_scenario
from volery.runtime.warmup.requirements import needs_of
from volery.runtime.warmup.tasks import do

for task in needs_of(load_scenario("forest_survey"))[::-1]:
    do(task)
"""
_FLY = """
from compile_watch import CompileWatch
from volery import Simulation, load_scenario

watch = CompileWatch()
with Simulation(load_scenario("forest_survey"), threads=1) as simulation:
    before = len(watch.compiled)
    simulation.diagnostics.enable_digest()
    simulation.run(2.0)
    print(simulation.diagnostics.digest(), before, len(watch.compiled) - before)
"""
_TESTS = Path(__file__).parent.parent


@pytest.mark.slow
def test_digests_of_caches_filled_in_other_orders_are_equal(tmp_path: Path) -> None:
    """One by a first start, with its helper; one backwards, by another process than flies."""
    with ThreadPoolExecutor() as pool:
        first, later = pool.map(_fly, (tmp_path / "first", tmp_path / "backwards"))
    assert len(first[0]) == 64
    assert first[0] == later[0]
    assert int(first[1]) > 0
    assert int(later[1]) == 0
    assert first[2] == later[2] == "0"  # nothing compiles in flight


def _fly(cache: Path) -> list[str]:
    """Returns digest, number of kernels compiled before the flight, and during it."""
    if cache.name == "backwards":
        _run(cache, _COMPILE_BACKWARDS)
    return _run(cache, _FLY).split()


def _run(cache: Path, script: str) -> str:
    paths = [str(_TESTS), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
            "VOLERY_CACHE_DIR": str(cache),
        },
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout
