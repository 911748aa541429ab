"""From a scenario to a running system: the only place that joins all branches."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from volery.runtime.progress import Progress
    from volery.runtime.simulation import Simulation

__all__ = ["Progress", "Simulation"]


def __getattr__(name: str) -> Any:
    """Import the simulation when it is asked for, not with its neighbours."""
    if name in __all__:
        return getattr(import_module("volery.runtime.simulation"), name)
    raise AttributeError(f"module 'volery.runtime' has no attribute '{name}'")
