"""No flight depends on memory that is read before it is written.

Two processes whose new memory is filled with different bytes by the C library fly the same. On
systems without glibc both are alike.
"""

import json
import os
import subprocess
import sys

import pytest

FLIGHTS = {
    "v_formation": 45.0,
    "v_formation_distributed": 30.0,
    "flock": 12.0,
    "forest_search": 4.0,
    "cooperative_search": 5.0,
    "coverage": 5.0,
    "servoing": 4.0,
    "policy_homing": 5.0,
    "obstacle_field": 5.0,
}
FLY = """
import hashlib, json, sys
import numpy as np
from volery import Simulation, load_scenario
from volery.autonomy.swarm.ares import AresSettings
from volery.autonomy.swarm.formation_search import plan_formation
from volery.autonomy.swarm.particle_swarm import FlockLimits

rng = np.random.default_rng(3)
start = 1.5 * np.stack(np.divmod(np.arange(7), 3), axis=1) + rng.uniform(-0.2, 0.2, (7, 2))
settings = AresSettings(limits=FlockLimits(min_distance=1.0))
plan = plan_formation(start, rng.uniform(0.25, 0.75, (7, 2)), settings=settings)
digests = {"plan": hashlib.sha256(plan.positions.tobytes()).hexdigest()}
for name, seconds in json.loads(sys.argv[1]).items():
    with Simulation(load_scenario(name), threads=1) as simulation:
        simulation.diagnostics.enable_digest()
        simulation.run(seconds)
        digests[name] = simulation.diagnostics.digest(by_topic=True)
print(json.dumps(digests))
"""
TINY, HUGE = 85, 1
"""Bytes with which numbers in new memory are about 1e-103 and -1e303."""
TIMEOUT_S = 1800.0


def start(byte):
    """Starts a process whose freed and new memory is filled with a byte and its complement."""
    environment = {
        "MALLOC_PERTURB_": str(byte),
        "GLIBC_TUNABLES": "glibc.malloc.tcache_count=0",  # whose memory is not filled
        "PYTHONMALLOC": "malloc",
    }
    return subprocess.Popen(
        [sys.executable, "-c", FLY, json.dumps(FLIGHTS)],
        env={**os.environ, **environment},
        stdout=subprocess.PIPE,
        text=True,
    )


@pytest.mark.slow
def test_flights_with_differently_filled_memory_are_equal():
    children = [start(byte) for byte in (TINY, HUGE)]
    outputs = [child.communicate(timeout=TIMEOUT_S)[0] for child in children]
    first, second = map(json.loads, outputs)
    assert first.keys() == {"plan", *FLIGHTS}
    assert first == second
