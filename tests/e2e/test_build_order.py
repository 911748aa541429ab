"""Results do not depend on the order in which kernels were compiled into the cache."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

_ORDERS = (
    ("compile_dynamics", "compile_guidance", "compile_sensors"),
    ("compile_sensors", "compile_guidance", "compile_dynamics"),
)
_FLY = """
import sys
from volery import Simulation, load_scenario
from volery.core.compiled import cache_dir
from volery.runtime import warm_up

for part in sys.argv[1:]:
    getattr(warm_up, part)()
(cache_dir() / "complete").touch()
with Simulation(load_scenario("forest_survey"), threads=1) as simulation:
    simulation.enable_digest()
    simulation.run(2.0)
    print(simulation.digest())
"""


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_digests_of_caches_filled_in_other_orders_are_equal(tmp_path: Path) -> None:
    digests = {_digest(tmp_path / f"cache{number}", order) for number, order in enumerate(_ORDERS)}
    assert len(digests) == 1


def _digest(cache: Path, order: tuple[str, ...]) -> str:
    """Compile in one process, in this order, and fly in another, which reads the cache."""
    environment = {**os.environ, "VOLERY_CACHE_DIR": str(cache)}
    for parts in (order, ()):
        done = subprocess.run(
            [sys.executable, "-c", _FLY, *parts],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
    return done.stdout.strip()
