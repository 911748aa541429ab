"""Volery: many UAVs with LIDARs in lock step.

import volery

with volery.make("hover", uavs=4, wind=(3.0, 0.0, 0.0)) as simulation:
    simulation.run(5.0)
    print(simulation.uavs["uav1"].position_map)

docs/api_stability.md names the public modules and how they may change.
"""

from __future__ import annotations

import sys as _sys
from importlib import import_module

TYPE_CHECKING = False
"""As in `typing`, whose import takes longer than the rest of this module."""

if TYPE_CHECKING:
    from typing import Any

    from volery.control.flight_modes import FlightMode
    from volery.control.trajectory import Trajectory
    from volery.core.errors import (
        BridgeError,
        CommandError,
        CommsError,
        DataFileError,
        DivergenceError,
        DivisionError,
        EstimatorError,
        FlightError,
        GraphError,
        NodeError,
        PartnerError,
        PatternError,
        PlacementError,
        PlanError,
        RecordingError,
        ScenarioError,
        SensorError,
        SnapshotError,
        SpawnError,
        SpawnFault,
        UnreachableError,
        VoleryError,
        WaitTimeoutError,
    )
    from volery.graph.nodes.node import Node
    from volery.logs import open_log
    from volery.runtime.environment_start import EnvironmentStart
    from volery.runtime.simulation import Simulation
    from volery.runtime.simulation_factory import make
    from volery.runtime.vectorized_simulation import VectorizedSimulation
    from volery.scenario.load import list_scenarios, load_scenario
    from volery.scenario.schema import Scenario

    __version__: str

__all__ = [
    "BridgeError",
    "CommandError",
    "CommsError",
    "DataFileError",
    "DivergenceError",
    "DivisionError",
    "EnvironmentStart",
    "EstimatorError",
    "FlightError",
    "FlightMode",
    "GraphError",
    "Node",
    "NodeError",
    "PartnerError",
    "PatternError",
    "PlacementError",
    "PlanError",
    "RecordingError",
    "Scenario",
    "ScenarioError",
    "SensorError",
    "Simulation",
    "SnapshotError",
    "SpawnError",
    "SpawnFault",
    "Trajectory",
    "UnreachableError",
    "VectorizedSimulation",
    "VoleryError",
    "WaitTimeoutError",
    "list_scenarios",
    "load_scenario",
    "make",
    "open_log",
]

_MODULES = {
    "EnvironmentStart": "volery.runtime.environment_start",
    "FlightMode": "volery.control.flight_modes",
    "Node": "volery.graph.nodes.node",
    "Scenario": "volery.scenario.schema",
    "Simulation": "volery.runtime.simulation",
    "Trajectory": "volery.control.trajectory",
    "VectorizedSimulation": "volery.runtime.vectorized_simulation",
    "list_scenarios": "volery.scenario.load",
    "load_scenario": "volery.scenario.load",
    "make": "volery.runtime.simulation_factory",
    "open_log": "volery.logs",
}
"""Modules of the exported names; those of the errors are all in `_ERRORS`."""
_ERRORS = "volery.core.errors"


def __getattr__(name: str) -> Any:
    """Imports a name when it is used: `import volery` itself imports nothing."""
    if name == "__version__":
        from importlib.metadata import version

        return version("volery")
    if name in __all__:
        return getattr(import_module(_MODULES.get(name, _ERRORS)), name)
    raise AttributeError(f"module 'volery' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})


class _LateFinder:
    """Finds ROS's packages that nothing else provides: `from avoid import Avoid` in a script.

    The file of a ROS 2 node is then imported before a scenario loads a node; see
    `graph.nodes.imports`.
    """

    offers_ros = True

    def find_spec(self, name: str, path: Any, target: Any = None) -> Any:
        """Imports the stand-ins when the first of them is wanted, as the last of the finders."""
        starts = ("rclpy", "message_filters", "sensor_msgs_py", "tf2_", "tf_transformations")
        ends = ("_msgs", "_srvs", "_interfaces")
        if "." in name or not (name.startswith(starts) or name.endswith(ends)):
            return None
        return import_module("volery.graph.nodes.imports").find_stand_in(name, path, target)


_sys.meta_path.append(_LateFinder())
