"""Publishes the state of a running simulation: poses, vehicles, progress, load."""

from __future__ import annotations

from volery.runtime.monitoring.monitor import Monitor

__all__ = ["Monitor"]
