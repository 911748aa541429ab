"""Volery: many UAVs with LIDARs in lock step.

from volery import Simulation, load_scenario

with Simulation(load_scenario("hover")) as simulation:
    simulation.run(5.0)
    print(simulation.uavs["uav1"].position_map)
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from volery.runtime import Simulation, VectorizedSimulation
    from volery.scenario.load import load_scenario
    from volery.scenario.schema import Scenario

__all__ = ["Scenario", "Simulation", "VectorizedSimulation", "load_scenario"]
__version__ = version("volery")

_HOMES = {
    "VectorizedSimulation": "volery.runtime",
    "Scenario": "volery.scenario.schema",
    "Simulation": "volery.runtime",
    "load_scenario": "volery.scenario.load",
}


def __getattr__(name: str) -> Any:
    """Import what is asked for, when it is asked for: `import volery` stays fast."""
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'volery' has no attribute '{name}'")
