"""Keeping and taking back the state of a flight: ten UAVs of the main job in the air."""

from __future__ import annotations

import statistics
import time
from typing import Any

from volery.runtime import Simulation
from volery.scenario import overrides
from volery.scenario.load import load_scenario

_ROUNDS = 40


def measure() -> dict[str, float]:
    """Medians: ms to keep a state, to go back to it, and to start anew with another seed."""
    scenario = overrides.apply(load_scenario("forest_survey"), uavs=10)
    fixed = scenario.with_(world={"seed": scenario.seed})  # what resets with other seeds need
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
