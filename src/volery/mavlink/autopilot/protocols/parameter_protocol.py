"""The parameter protocol, as implemented by PX4."""

from __future__ import annotations

import struct
from typing import Any

from volery.mavlink.autopilot.client_links import LinkState
from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.parameters import (
    CHECK,
    DEFAULTS,
    NAMES,
    UINT32,
    check_of,
    from_wire,
    on_wire,
    refusal,
    type_of,
)
from volery.mavlink.autopilot.state import Source
from volery.mavlink.codec import dialect

_DOES_NOT_EXIST, _OUT_OF_RANGE, _READ_ONLY, _WRONG_TYPE = 1, 2, 5, 7
"""Values of MAV_PARAM_ERROR."""
A_TICK = 2
"""Values that a list sends at each state of the vehicle: 200 a second, no burst for slow lines."""


def send_list(context: AutopilotContext, source: Source, _message: Any) -> None:
    """Starts to send all values on the link, the check value first."""
    _send_check(context, source[0])
    context.links.open[source[0]].parameters_to_send = list(reversed(range(len(NAMES))))


def send_some(context: AutopilotContext, link: LinkState) -> None:
    """Continues a list."""
    for _ in range(min(A_TICK, len(link.parameters_to_send))):
        _send_value(context, link.number, NAMES[link.parameters_to_send.pop()])


def send_one(context: AutopilotContext, source: Source, message: Any) -> None:
    """Answers PARAM_REQUEST_READ; for an unknown parameter with PARAM_ERROR."""
    name, index = message.param_id, message.param_index
    if 0 <= index < len(NAMES):
        name = NAMES[index]
    if index < 0 and name == CHECK:
        _send_check(context, source[0])
    elif index < len(NAMES) and name in DEFAULTS:
        _send_value(context, source[0], name)
    else:
        _send_fault(context, source, "" if index >= 0 else name, _DOES_NOT_EXIST, index)


def set_one(context: AutopilotContext, source: Source, message: Any) -> None:
    """Sets a parameter and reports it on all links.

    After a refusal, reports the reason and the current value.
    """
    name = message.param_id
    if name == CHECK:  # a client whose list is up to date cancels it
        context.links.open[source[0]].parameters_to_send = []
        _send_fault(context, source, name, _READ_ONLY)
        return
    if name not in DEFAULTS:
        context.report(4, f"unknown param: {name}")
        _send_fault(context, source, name, _DOES_NOT_EXIST)
        return
    value = from_wire(message.param_type, message.param_value)
    fault, why = 0, ""
    if message.param_type != type_of(name):
        fault, why = _WRONG_TYPE, f"{name}: param types mismatch"
    elif value is None or (why := refusal(name, value)):
        fault = _READ_ONLY if DEFAULTS[name].fixed else _OUT_OF_RANGE
    if fault or value is None:
        context.report(4, why)
        _send_fault(context, source, name, fault)
        _send_value(context, source[0], name)
        return
    context.memory.parameters[name] = value
    context.log.note_parameter(name, value)
    for number in context.links.open:
        _send_value(context, number, name)


def _send_fault(
    context: AutopilotContext, source: Source, name: str, fault: int, index: int = -1
) -> None:
    """Sends PARAM_ERROR, which pymavlink has since 2025."""
    message = getattr(dialect(), "MAVLink_param_error_message", None)
    if message is not None:
        link, system, component = source
        context.links.send(message(system, component, name.encode(), index, fault), link)


def _send_check(context: AutopilotContext, link: int) -> None:
    check = struct.pack("<I", check_of(context.memory.parameters))
    message = dialect().MAVLink_param_value_message
    context.links.send(
        message(CHECK.encode(), *struct.unpack("<f", check), UINT32, len(NAMES), 65535), link
    )


def _send_value(context: AutopilotContext, link: int, name: str) -> None:
    value = on_wire(name, context.memory.parameters[name])
    message = dialect().MAVLink_param_value_message(
        name.encode(), value, type_of(name), len(NAMES), NAMES.index(name)
    )
    context.links.send(message, link)
