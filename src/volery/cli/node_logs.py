"""Prints nodes' logs at the terminal, as rclpy does: `[INFO] [12.500000000] [uav1.node]: ..`."""

from __future__ import annotations

import logging

import typer

from volery.core.plain_text import plain_message
from volery.graph.nodes import PYTHON_LOGGER

_LEVELS = {logging.WARNING: "WARN", logging.CRITICAL: "FATAL"}


class _Terminal(logging.Handler):
    """Writes a line to stderr."""

    def emit(self, record: logging.LogRecord) -> None:
        """Implements `logging.Handler`."""
        level = _LEVELS.get(record.levelno, record.levelname)
        time, node = getattr(record, "node_time", ""), getattr(record, "node", record.name)
        text = f"[{level}] [{time}] [{node}]: {record.getMessage()}"
        typer.echo(plain_message(text), err=True)


def show_node_logs() -> None:
    """Shows the logs from now on; the nodes' own levels filter them."""
    logger = logging.getLogger(PYTHON_LOGGER)
    if not any(isinstance(handler, _Terminal) for handler in logger.handlers):
        logger.addHandler(_Terminal())
        logger.setLevel(logging.DEBUG)
        logger.propagate = False
