"""What is wrong, told once."""

from __future__ import annotations

import logging

_log = logging.getLogger(__name__)
_MOST = 10_000
"""Things that are remembered as told; beyond, nothing more is told."""


class Complaints:
    """Warnings of names that something is wrong with."""

    def __init__(self) -> None:
        self._told: set[tuple[str, str]] = set()

    def tell(self, name: str, text: str) -> None:
        """Warn of something, the first time."""
        if (name, text) not in self._told and len(self._told) < _MOST:
            self._told.add((name, text))
            _log.warning("ROS 2: %s: %s", name, text)
