"""Services that control the simulation and its UAVs, on the graph."""

from __future__ import annotations

from volery.runtime.services.opening import Services, open_services

__all__ = ["Services", "open_services"]
