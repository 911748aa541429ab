"""Creates the services on the graph that control the simulation and its UAVs."""

from __future__ import annotations

from volery.runtime.services.service_set import ServiceSet, open_services

__all__ = ["ServiceSet", "open_services"]
