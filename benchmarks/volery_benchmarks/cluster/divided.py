"""Measures one run on two machines beside the same run on one: speed-up and digest.

Two network namespaces with a core each stand for the machines. Both runs fly the same simulated
time, alternately; the first seconds, in which the UAVs take off, are not counted.
"""

from __future__ import annotations

import json
import logging
import statistics
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from volery.core.errors import VoleryError
from volery_benchmarks.cluster import namespaces

_LOG = logging.getLogger(__name__)
_ROUNDS, _QUICK_ROUNDS = 5, 1
_PORT = 8790
_TOKEN = "two machines"
_Flight = tuple[str, dict[str, Any], float, float]
_FLIGHTS: dict[str, _Flight] = {
    "split": ("forest_survey", {"uavs[0].count": 40}, 4.0, 10.0),
    "split_cameras": (
        "obstacle_field",
        {
            "uavs[0].count": 8,
            "uavs[0].last_position_m": [-35.0, 0.0],
            "types.scout.sensors[0].width": 320,
            "types.scout.sensors[0].height": 240,
        },
        3.0,
        5.0,
    ),
}
"""Scenario, its changes, simulated s before and during the measurement."""
_LEADER = """
import json, sys, time
from volery import Simulation, load_scenario

name, changes, before_s, flown_s, address = sys.argv[1:6]
scenario = load_scenario(name).with_(json.loads(changes))
digest = sys.argv[6] == "digest"


def fly(simulation):
    if digest:
        simulation.diagnostics.enable_digest()
    simulation.run(float(before_s))
    start = time.perf_counter()
    simulation.run(float(flown_s))
    wall_s = time.perf_counter() - start
    return wall_s, simulation.diagnostics.digest(by_topic=True) if digest else ""


if address:
    from volery.cluster.division.workers import DivisionOptions, Workers

    listen = address.rpartition(":")[0], int(address.rpartition(":")[2])
    options = DivisionOptions(1, listen, "two machines")
    with Workers(options, scenario, lambda _line: None) as workers:
        partition = workers.gather()
        with Simulation(scenario, threads=1, partition=partition) as simulation:
            simulation.divide(workers.connect)
            wall_s, found = fly(simulation)
else:
    with Simulation(scenario, threads=1) as simulation:
        wall_s, found = fly(simulation)
print(json.dumps([wall_s, found]))
"""


def measure(*, quick: bool = False) -> dict[str, float]:
    """Returns the figures."""
    figures: dict[str, float] = {}
    rounds = _QUICK_ROUNDS if quick else _ROUNDS
    with namespaces.namespaces():
        for name, flight in _FLIGHTS.items():
            ratios = [_fly(flight, "")[0] / _fly(flight, "both")[0] for _ in range(rounds)]
            figures[f"{name}_speed_up"] = statistics.median(ratios)
            figures[f"{name}_efficiency"] = statistics.median(ratios) / 2.0
            digests = {_fly(flight, machines, "digest")[1] for machines in ("", "both")}
            figures[f"{name}_digests_equal"] = float(len(digests) == 1)
    return figures


def _fly(flight: _Flight, machines: str, digest: str = "") -> tuple[float, str]:
    """Returns wall time, s, and digest of a flight on the first machine or on both."""
    address = f"{namespaces.ADDRESSES[0]}:{_PORT}" if machines else ""
    name, changes, *times = flight
    words = [name, json.dumps(changes), *map(str, times), address, digest]
    leader = _start(0, ["-c", _LEADER, *words])
    worker = None
    if machines:
        join = ["worker", "--join", address, "--token", _TOKEN, "--threads", "1"]
        worker = _start(1, ["-m", "volery", *join])
    output = leader.communicate()[0]
    if worker is not None:
        worker.communicate()
    if leader.returncode:
        raise VoleryError(f"{name} on {machines or 'one'}: exit code {leader.returncode}")
    wall_s, found = json.loads(output.splitlines()[-1])
    _LOG.info("%s on %s: %.2f s", name, machines or "one", wall_s)
    return wall_s, found


def _start(machine: int, words: Sequence[str]) -> subprocess.Popen[str]:
    command = namespaces.on(machine, [str(Path(sys.executable)), "-P", *words])
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
