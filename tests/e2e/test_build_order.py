"""Results do not depend on the order in which kernels were compiled into the cache."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

_COMPILE = """
import sys
from volery import load_scenario
from volery.runtime.warmup.requirements import needs_of
from volery.runtime.warmup.tasks import do

for task in needs_of(load_scenario("forest_survey"))[:: int(sys.argv[1])]:
    do(task)
"""
_FLY = """
from volery import Simulation, load_scenario

with Simulation(load_scenario("forest_survey"), threads=1) as simulation:
    simulation.diagnostics.enable_digest()
    simulation.run(2.0)
    print(simulation.diagnostics.digest())
"""


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_digests_of_caches_filled_in_other_orders_are_equal(tmp_path: Path) -> None:
    caches = [tmp_path / name for name in ("forwards", "backwards")]
    with ThreadPoolExecutor() as pool:
        digests = list(pool.map(_digest, caches, (1, -1)))
    assert len(digests[0]) == 64
    assert len(set(digests)) == 1


def _digest(cache: Path, step: int) -> str:
    """Compile in one process, in this order, and fly in another, which reads the cache."""
    _run(cache, _COMPILE, str(step))
    return _run(cache, _FLY)


def _run(cache: Path, script: str, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments],
        env={**os.environ, "VOLERY_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()
