"""From a scenario to a running system: the only place that joins all branches."""

from volery.runtime.simulation import Progress, Simulation

__all__ = ["Progress", "Simulation"]
