"""Selects the names that a simulation shares with a ROS graph, and their direction."""

from __future__ import annotations

import fnmatch

COMMANDS = ("*/cmd_vel", "*/trajectory", "*/goal_pose")
"""Topics received from the ROS graph even if the simulation publishes them."""

_NOT_SHARED = frozenset({"/rosout", "/rosout_agg"})


class SharedNames:
    """Selects names by patterns of `fnmatch`.

    patterns: of shared topics and services. commands: of topics that other publishers may publish
    besides those of the simulation.
    """

    def __init__(self, patterns: tuple[str, ...], commands: tuple[str, ...] = COMMANDS) -> None:
        self._patterns = patterns
        self._commands = commands

    def has(self, name: str) -> bool:
        """Returns whether a topic or service is shared."""
        return name not in _NOT_SHARED and any(fnmatch.fnmatch(name, p) for p in self._patterns)

    def takes(self, topic: str, publishers: int, subscribers: int) -> bool:
        """Returns whether messages of a topic are received from the ROS graph."""
        if not subscribers:
            return False
        return not publishers or any(fnmatch.fnmatch(topic, p) for p in self._commands)
