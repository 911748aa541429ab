"""Handles MAVLink's log protocol: clients list the flight logs of a vehicle and read them."""

from __future__ import annotations

from typing import Any

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.state import Source


def list_logs(context: AutopilotContext, source: Source, message: Any) -> None:
    """Handles LOG_REQUEST_LIST."""
    context.log.transfers.list_logs(source[0], message.start, message.end)


def send_data(context: AutopilotContext, source: Source, message: Any) -> None:
    """Handles LOG_REQUEST_DATA; nothing is sent for a missing log, as in PX4."""
    parts = int(message.id), int(message.ofs), int(message.count)
    context.log.transfers.send_data(source[0], *parts)


def erase(context: AutopilotContext, _source: Source, _message: Any) -> None:
    """Handles LOG_ERASE: deletes all logs except for that of the current flight."""
    context.log.transfers.clear()
    context.log.storage.erase(keeps_newest=context.log.is_recording)


def end(context: AutopilotContext, source: Source, _message: Any) -> None:
    """Handles LOG_REQUEST_END."""
    context.log.transfers.forget(source[0])
