"""Which names a simulation and a ROS graph beside it share, and in which direction."""

from __future__ import annotations

import fnmatch

COMMANDS = ("*/cmd_vel", "*/trajectory", "*/goal_pose")
"""Topics taken from outside also where the graph has publishers of its own."""

_NOT_SHARED = frozenset({"/rosout", "/rosout_agg"})


class SharedNames:
    """Patterns of names, as `fnmatch` has them.

    patterns: of topics and services that are shared at all. commands: of topics that others may
    publish beside publishers of the graph.
    """

    def __init__(self, patterns: tuple[str, ...], commands: tuple[str, ...] = COMMANDS) -> None:
        self._patterns = patterns
        self._commands = commands

    def has(self, name: str) -> bool:
        """Whether a topic or service is shared at all."""
        return name not in _NOT_SHARED and any(fnmatch.fnmatch(name, p) for p in self._patterns)

    def takes(self, topic: str, publishers: int, subscribers: int) -> bool:
        """Whether messages of a topic are taken from outside."""
        if not subscribers:
            return False
        return not publishers or any(fnmatch.fnmatch(topic, p) for p in self._commands)
