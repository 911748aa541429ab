"""What people who watch are told of a running simulation: places, vehicles, how it runs."""

from __future__ import annotations

from volery.runtime.monitoring.monitor import Monitor

__all__ = ["Monitor"]
