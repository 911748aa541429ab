"""What is wrong, told once."""

from __future__ import annotations

import logging
from collections.abc import Callable

from volery.core.errors import GraphError

_log = logging.getLogger(__name__)
_MOST = 10_000
"""Things that are remembered as told; beyond, nothing more is told."""


class WarningFilter:
    """Warnings of names that something is wrong with."""

    def __init__(self) -> None:
        self._told: set[tuple[str, str]] = set()
        self._refused: set[str] = set()

    def tried(self, name: str, action: Callable[[], object]) -> None:
        """Do something for a name; where that fails, say why and never try again."""
        if name in self._refused:
            return
        try:
            action()
        except Exception as error:  # one name's trouble must not end the others
            self._refused.add(name)
            told = str(error) if isinstance(error, GraphError) else repr(error)
            self.tell(name, f"is not shared: {told}")

    def tell(self, name: str, text: str) -> None:
        """Warn of something, the first time."""
        if (name, text) not in self._told and len(self._told) < _MOST:
            self._told.add((name, text))
            _log.warning("ROS 2: %s: %s", name, text)
