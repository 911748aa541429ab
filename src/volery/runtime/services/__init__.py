"""Services that control the simulation and its UAVs, on the graph."""

from __future__ import annotations

from volery.runtime.services.service_set import Services, open_services

__all__ = ["Services", "open_services"]
