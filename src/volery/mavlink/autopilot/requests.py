"""Handles commands that request messages, once or periodically.

Answers for missing messages follow `mavlink_receiver.cpp` of PX4 1.18.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from volery.mavlink.autopilot import dialect_extensions, streams, telemetry

if TYPE_CHECKING:
    from volery.mavlink.autopilot.commands import Command
    from volery.mavlink.autopilot.core import Autopilot
    from volery.mavlink.autopilot.state import Source

_ACCEPTED, _DENIED, _FAILED = 0, 2, 4
"""Values of MAV_RESULT."""
RETIRED = {410: 242, 519: 300, 520: 148}
"""MAV_CMD that MAV_CMD_REQUEST_MESSAGE replaced, and the message that each requested."""


def set_interval(autopilot: Autopilot, source: Source, command: Command) -> int:
    """Handles SET_MESSAGE_INTERVAL; messages sent only to others or in parts are refused."""
    number, period_us, third, fourth, _, _, target = command.params
    if not (math.isfinite(number) and math.isfinite(period_us)):
        return _DENIED
    if any(math.isfinite(unused) and round(unused) for unused in (third, fourth, target)):
        return _FAILED
    link = autopilot.memory.links[source[0]]
    return _ACCEPTED if streams.ask_for(autopilot, link, round(number), period_us) else _FAILED


def get_interval(autopilot: Autopilot, source: Source, command: Command) -> int:
    """Handles GET_MESSAGE_INTERVAL: answers with MESSAGE_INTERVAL; -1: not sent."""
    return _tell_interval(autopilot, source, command.params[0])


def send(autopilot: Autopilot, source: Source, command: Command) -> int:
    """Handles REQUEST_MESSAGE."""
    number, what = command.params[:2]
    if not math.isfinite(number):
        return _DENIED
    if round(number) == telemetry.MESSAGE_INTERVAL:
        return _tell_interval(autopilot, source, what)
    if round(number) == dialect_extensions.AvailableModes.id:
        return _send(autopilot, source, dialect_extensions.available_modes(what))
    return _send_built(autopilot, source, round(number))


def send_as_of_old(autopilot: Autopilot, source: Source, command: Command) -> int:
    """Handles the old commands that request one message each."""
    return _send_built(autopilot, source, RETIRED[command.number])


def _send_built(autopilot: Autopilot, source: Source, number: int) -> int:
    build = telemetry.BUILDERS.get(number)
    message = None if build is None else build(autopilot)
    return _send(autopilot, source, [] if message is None else [message])


def _tell_interval(autopilot: Autopilot, source: Source, number: float) -> int:
    if not (math.isfinite(number) and 0 <= round(number) <= 65535):
        return _DENIED
    message = streams.interval_of(autopilot.memory.links[source[0]], round(number))
    return _send(autopilot, source, [message])


def _send(autopilot: Autopilot, source: Source, messages: list[Any]) -> int:
    for message in messages:
        autopilot.send(message, source[0])
    return _ACCEPTED if messages else _DENIED
