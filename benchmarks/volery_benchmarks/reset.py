"""Measures snapshots, restores and resets: ten UAVs of the main job in the air."""

from __future__ import annotations

import statistics
import time
from typing import Any

from volery.runtime import Simulation
from volery.scenario import overrides
from volery.scenario.load import load_scenario

_ROUNDS = 40


def measure() -> dict[str, float]:
    """Returns medians, ms: to save a snapshot, to restore it, to reset with another seed."""
    scenario = overrides.apply(load_scenario("forest_survey"), uavs=10)
    fixed = scenario.with_(world={"seed": scenario.seed})  # required by resets with other seeds
    with Simulation(fixed) as simulation:
        simulation.run(4.0)
        kept = simulation.snapshot()
        simulation.run(0.5)
        return {
            "snapshot_ms_10_uavs": _ms(simulation.snapshot),
            "restore_ms_10_uavs": _ms(lambda: simulation.restore(kept)),
            "reset_ms_10_uavs": _ms(lambda: simulation.reset(7)),
        }


def _ms(action: Any) -> float:
    times = []
    for _ in range(_ROUNDS):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return 1e3 * statistics.median(times)
