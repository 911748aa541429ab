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
    "flock": 12.0,
    "forest_search": 4.0,
    "cooperative_search": 5.0,
    "coverage": 5.0,
    "servoing": 4.0,
    "policy_homing": 5.0,
    "obstacle_field": 5.0,
}
FLY = """
import json, sys
from volery import Simulation, load_scenario

digests = {}
for name, seconds in json.loads(sys.argv[1]).items():
    with Simulation(load_scenario(name), threads=1) as simulation:
        simulation.diagnostics.enable_digest()
        simulation.run(seconds)
        digests[name] = simulation.diagnostics.digest(by_topic=True)
print(json.dumps(digests))
"""
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
    children = [start(byte) for byte in (85, 200)]
    outputs = [child.communicate(timeout=TIMEOUT_S)[0] for child in children]
    first, second = map(json.loads, outputs)
    assert len(first) == len(FLIGHTS)
    assert first == second
