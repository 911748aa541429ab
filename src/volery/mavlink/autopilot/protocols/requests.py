"""Handles commands that request messages, once or periodically.

Answers for missing messages follow `mavlink_receiver.cpp` of PX4 1.18.
"""

from __future__ import annotations

import math
from typing import Any

from volery.mavlink.autopilot.client_links import ALL_LINKS
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.messages import dialect_extensions, streams, telemetry
from volery.mavlink.autopilot.protocols.command_protocol import ACCEPTED, DENIED, FAILED, Command
from volery.mavlink.autopilot.state import Source

_BROADCAST, _TARGETS = 2, (0, 1, 2)
"""Receivers of a requested message: as usual or the requester, both over its link; everyone."""
FOR_ALL = (519, 520)
"""MAV_CMD that PX4 executes if they are for all systems and whatever their component."""
RETIRED = {410: 242, 519: 300, 520: 148}
"""MAV_CMD that MAV_CMD_REQUEST_MESSAGE replaced, and the message that each requested."""


def set_interval(context: AutopilotContext, source: Source, command: Command) -> int:
    """Handles SET_MESSAGE_INTERVAL; messages sent only to others or in parts are refused."""
    number, period_us, third, fourth, _, _, target = command.params
    if not (math.isfinite(number) and math.isfinite(period_us)):
        return DENIED
    if any(math.isfinite(unused) and round(unused) for unused in (third, fourth, target)):
        return FAILED
    link = context.links.open.get(source[0])  # MAVROS's topics come over no link
    if link is None or not streams.set_period(
        link, round(number), period_us, context.memory.now_ns
    ):
        return FAILED
    return ACCEPTED


def get_interval(context: AutopilotContext, source: Source, command: Command) -> int:
    """Handles GET_MESSAGE_INTERVAL: answers with MESSAGE_INTERVAL; -1: not sent."""
    return _send_interval(context, source, command.params[0])


def send(context: AutopilotContext, source: Source, command: Command) -> int:
    """Handles REQUEST_MESSAGE."""
    number, what, *_, target = command.params
    whom = round(target) if math.isfinite(target) else 0
    if not math.isfinite(number) or whom not in _TARGETS:
        return DENIED
    if whom == _BROADCAST:
        source = (ALL_LINKS, *source[1:])
    if round(number) == telemetry.MESSAGE_INTERVAL:
        return _send_interval(context, source, what)
    if round(number) == dialect_extensions.AvailableModes.id:
        return _send(context, source, dialect_extensions.available_modes(what))
    return _send_built(context, source, round(number))


def send_as_of_old(context: AutopilotContext, source: Source, command: Command) -> int:
    """Handles the old commands that request one message each."""
    return _send_built(context, source, RETIRED[command.number])


def _send_built(context: AutopilotContext, source: Source, number: int) -> int:
    build = telemetry.BUILDERS.get(number)
    message = None if build is None else build(context)
    return _send(context, source, [] if message is None else [message])


def _send_interval(context: AutopilotContext, source: Source, number: float) -> int:
    if not (math.isfinite(number) and 0 <= round(number) <= 65535):
        return DENIED
    link = context.links.open.get(source[0])
    if link is None:
        return FAILED
    return _send(context, source, [streams.interval_of(link, round(number))])


def _send(context: AutopilotContext, source: Source, messages: list[Any]) -> int:
    for message in messages:
        context.links.send(message, source[0])
    return ACCEPTED if messages else DENIED
