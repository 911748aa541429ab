"""Logs each warning once."""

from __future__ import annotations

import logging
from collections.abc import Callable

from volery.core.errors import GraphError

_log = logging.getLogger(__name__)
_MAX_WARNINGS = 10_000
"""Number of stored warnings; beyond, none is logged."""


class WarningFilter:
    """Warnings by name."""

    def __init__(self) -> None:
        self._logged: set[tuple[str, str]] = set()
        self._refused: set[str] = set()

    def tried(self, name: str, action: Callable[[], object]) -> None:
        """Runs an action for a name; if it fails, logs the reason and never tries again."""
        if name in self._refused:
            return
        try:
            action()
        except Exception as error:  # an error of one name must not end the others
            self._refused.add(name)
            reason = str(error) if isinstance(error, GraphError) else repr(error)
            self.warn(name, f"is not shared: {reason}")

    def warn(self, name: str, text: str) -> None:
        """Logs a warning, the first time."""
        if (name, text) not in self._logged and len(self._logged) < _MAX_WARNINGS:
            self._logged.add((name, text))
            _log.warning("ROS 2: %s: %s", name, text)
