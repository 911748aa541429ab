"""Provides loggers like rclpy's: levels, `once`, `throttle_duration_sec`, `skip_first`.

A node's lines go to Python's `logging`, as logger `volery.nodes.NAME` (the command line prints
them), and to `/rosout`, which recordings and clients receive. Times are the node's: simulated in a
simulation. File and line identify a statement.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from enum import IntEnum
from pathlib import Path
from typing import Any

from volery.core.clock import NS_PER_S, ns_from_s
from volery.graph.messages import message_type, time_from_ns
from volery.graph.nodes import PYTHON_LOGGER

ROSOUT = "/rosout"
LOG_TYPE = "rcl_interfaces/msg/Log"

CodeLocation = tuple[str, str, int]
"""File, function and line of a call."""


class LoggingSeverity(IntEnum):
    """Levels, numbered as in `rcl_interfaces/msg/Log` and in Python's `logging`."""

    UNSET = 0
    DEBUG = 10
    INFO = 20
    WARN = 30
    ERROR = 40
    FATAL = 50


class NodeLogger:
    """Logger of a node, or a child of one."""

    def __init__(
        self,
        name: str,
        now_ns: Callable[[], int],
        publish: Callable[[Any], None] | None,
        parent: NodeLogger | None = None,
    ) -> None:
        self.name = name
        self._now_ns = now_ns
        self._publish = publish
        self._parent = parent
        self._level = LoggingSeverity.UNSET
        self._last_ns: dict[CodeLocation, int] = {}
        """Time of the last line of each statement that is throttled or logged once."""
        self._seen: set[CodeLocation] = set()
        """Statements with `skip_first` that have been skipped."""
        self._python = logging.getLogger(f"{PYTHON_LOGGER}.{name}")

    # ------------------------------------------------------------------------------------ levels

    def set_level(self, level: LoggingSeverity | int) -> None:
        """Sets the lowest logged level; UNSET: the parent's, or INFO without parent."""
        self._level = LoggingSeverity(level)

    def get_effective_level(self) -> LoggingSeverity:
        """Returns the lowest logged level."""
        if self._level:
            return self._level
        return LoggingSeverity.INFO if self._parent is None else self._parent.get_effective_level()

    def is_enabled_for(self, severity: LoggingSeverity | int) -> bool:
        """Returns whether that level is logged."""
        return severity >= self.get_effective_level()

    def get_child(self, name: str) -> NodeLogger:
        """Returns the logger of a part of the node, named below this one."""
        return NodeLogger(f"{self.name}.{name}", self._now_ns, self._publish, self)

    # ------------------------------------------------------------------------------------ logging

    def debug(self, message: str, **options: Any) -> bool:
        """Logs at level DEBUG; returns whether the line was logged."""
        return self._log(message, LoggingSeverity.DEBUG, options)

    def info(self, message: str, **options: Any) -> bool:
        """Logs at level INFO; returns whether the line was logged."""
        return self._log(message, LoggingSeverity.INFO, options)

    def warning(self, message: str, **options: Any) -> bool:
        """Logs at level WARN; returns whether the line was logged."""
        return self._log(message, LoggingSeverity.WARN, options)

    warn = warning

    def error(self, message: str, **options: Any) -> bool:
        """Logs at level ERROR; returns whether the line was logged."""
        return self._log(message, LoggingSeverity.ERROR, options)

    def fatal(self, message: str, **options: Any) -> bool:
        """Logs at level FATAL; returns whether the line was logged."""
        return self._log(message, LoggingSeverity.FATAL, options)

    def log(self, message: str, severity: LoggingSeverity | int, **options: Any) -> bool:
        """Logs at the given level; returns whether the line was logged."""
        return self._log(message, LoggingSeverity(severity), options)

    def _log(self, message: str, severity: LoggingSeverity, options: dict[str, Any]) -> bool:
        if not self.is_enabled_for(severity):
            return False
        frame = sys._getframe(2)
        location = (frame.f_code.co_filename, frame.f_code.co_qualname, frame.f_lineno)
        now_ns = self._now_ns()
        if options and not self._is_due(location, now_ns, **options):
            return False
        python_log(self._python, self.name, now_ns, severity, str(message))
        if self._publish is not None:
            self._publish(log_message(self.name, now_ns, severity, str(message), location))
        return True

    def _is_due(
        self,
        location: CodeLocation,
        now_ns: int,
        *,
        once: bool = False,
        throttle_duration_sec: float | None = None,
        skip_first: bool = False,
        throttle_time_source_type: Any = None,  # noqa: ARG002  # always simulated time
    ) -> bool:
        if skip_first and location not in self._seen:
            self._seen.add(location)
            return False
        last_ns = self._last_ns.get(location)
        if last_ns is not None and last_ns <= now_ns:  # later times are from before a reset
            if once:
                return False
            if throttle_duration_sec and now_ns - last_ns < ns_from_s(throttle_duration_sec):
                return False
        if once or throttle_duration_sec:
            self._last_ns[location] = now_ns
        return True

    def get_state(self) -> Any:
        """Returns the times and statements of the lines logged so far."""
        return dict(self._last_ns), set(self._seen)

    def set_state(self, state: Any) -> None:
        """Restores what `get_state` returned."""
        self._last_ns, self._seen = dict(state[0]), set(state[1])


def log_message(
    name: str, time_ns: int, severity: LoggingSeverity, text: str, location: CodeLocation
) -> Any:
    """Returns a `rcl_interfaces/msg/Log`; its file name has no folder, which varies."""
    file, function, line = location
    stamp = time_from_ns(time_ns)
    log: type[Any] = message_type(LOG_TYPE)
    return log(stamp, int(severity), name, text, Path(file).name, function, line)


def python_log(
    logger: logging.Logger, name: str, time_ns: int, severity: LoggingSeverity, text: str
) -> None:
    """Passes a line to Python's `logging`, with the node's name and time."""
    seconds, rest = divmod(time_ns, NS_PER_S)
    extra = {"node": name, "node_time": f"{seconds}.{rest:09d}"}
    logger.log(int(severity), "%s", text, extra=extra)
