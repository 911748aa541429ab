"""Services that control the simulation and its UAVs, on the graph."""

from __future__ import annotations

from volery.runtime.services.service_set import ServiceSet, open_services

__all__ = ["ServiceSet", "open_services"]
