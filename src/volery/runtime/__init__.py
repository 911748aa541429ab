"""Builds a running simulation from a scenario and joins all branches of the package."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from volery.runtime.monitoring.progress import Progress
    from volery.runtime.simulation import Simulation
    from volery.runtime.vectorized_simulation import VectorizedSimulation

__all__ = ["Progress", "Simulation", "VectorizedSimulation"]

_HOMES = {
    "VectorizedSimulation": "volery.runtime.vectorized_simulation",
    "Progress": "volery.runtime.monitoring.progress",
    "Simulation": "volery.runtime.simulation",
}


def __getattr__(name: str) -> Any:
    """Imports the requested name only, without its neighbours."""
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'volery.runtime' has no attribute '{name}'")
