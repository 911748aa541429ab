"""Compiles all kernels at the first start: dynamics here, the sensors' in a helper process.

On two cores the wait is halved: numba compiles one function at a time in a process. What the helper
compiles reaches this process through the cache on disk; a marker there tells later starts that
nothing is left to do.

    python -m volery.runtime.warm_up

does it ahead of time, as before parallel test workers.
"""

from __future__ import annotations

import os
import subprocess
import sys

from volery.control.fleet import Fleet
from volery.core.compiled import cache_dir
from volery.vehicle.airframe import load_airframe
from volery.world.terrain import Terrain

_IS_HELPER = "VOLERY_COMPILES_SENSORS"
_EVERY_SENSOR = {
    "name": "warm_up",
    "types": {
        "all": {
            "sensors": [
                {"kind": "lidar", "name": "nodding", "nodding": {}},
                {"kind": "imu"},
                {"kind": "sonar", "rpy_deg": [0.0, 90.0, 0.0]},
                {"kind": "odometry"},
                {"kind": "ground_truth"},
            ]
        }
    },
    "uavs": [{"type": "all", "count": 2, "position_m": [0.0, 0.0], "last_position_m": [3.0, 0.0]}],
}


def kernels_are_compiled() -> bool:
    """Whether the cache holds the kernels of this version already."""
    return (cache_dir() / "complete").exists()


def compile_kernels() -> None:
    """Compile what the cache lacks; returns at once where it is complete."""
    if kernels_are_compiled() or os.environ.get(_IS_HELPER):
        return
    helper = subprocess.Popen(
        [sys.executable, "-m", __name__],
        env={**os.environ, _IS_HELPER: "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        _compile_dynamics()
        # A helper that failed costs time, nothing else: the kernels compile when they are called.
        if helper.wait() == 0:
            (cache_dir() / "complete").touch()
    finally:
        helper.kill()
        helper.wait()


def _compile_dynamics() -> None:
    fleet = Fleet([load_airframe("f450")], [[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0, 1.0]])
    fleet.advance(0, Terrain.flat(extent_m=10.0).grid)


def _compile_sensors() -> None:
    """Let every kind of sensor measure once, without the dynamics."""
    from volery.runtime.simulation import Simulation
    from volery.scenario.load import parse_scenario

    scenario = parse_scenario(_EVERY_SENSOR, where="warm-up")
    with Simulation(scenario, threads=1) as simulation:
        simulation.measure_once()


if __name__ == "__main__":
    if os.environ.get(_IS_HELPER):
        _compile_sensors()
    else:
        compile_kernels()
