"""The parameter protocol, as implemented by PX4."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any

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
from volery.mavlink.codec import dialect

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot
    from volery.mavlink.autopilot.state import LinkState, Source

_DOES_NOT_EXIST, _OUT_OF_RANGE, _READ_ONLY, _WRONG_TYPE = 1, 2, 5, 7
"""Values of MAV_PARAM_ERROR."""
A_TICK = 2
"""Values that a list sends at each state of the vehicle: 200 a second, no burst for slow lines."""


def send_list(autopilot: Autopilot, source: Source, _message: Any) -> None:
    """Starts to send all values on the link, the check value first."""
    _tell_check(autopilot, source[0])
    autopilot.memory.links[source[0]].parameters_to_send = list(reversed(range(len(NAMES))))


def send_some(autopilot: Autopilot, link: LinkState) -> None:
    """Continues a list."""
    for _ in range(min(A_TICK, len(link.parameters_to_send))):
        _tell(autopilot, link.number, NAMES[link.parameters_to_send.pop()])


def send_one(autopilot: Autopilot, source: Source, message: Any) -> None:
    """Answers PARAM_REQUEST_READ; for an unknown parameter with PARAM_ERROR."""
    name, index = message.param_id, message.param_index
    if 0 <= index < len(NAMES):
        name = NAMES[index]
    if index < 0 and name == CHECK:
        _tell_check(autopilot, source[0])
    elif index < len(NAMES) and name in DEFAULTS:
        _tell(autopilot, source[0], name)
    else:
        _tell_fault(autopilot, source, "" if index >= 0 else name, _DOES_NOT_EXIST, index)


def set_one(autopilot: Autopilot, source: Source, message: Any) -> None:
    """Sets a parameter and reports it on all links.

    After a refusal, reports the reason and the current value.
    """
    name = message.param_id
    if name == CHECK:  # a client whose list is up to date cancels it
        autopilot.memory.links[source[0]].parameters_to_send = []
        _tell_fault(autopilot, source, name, _READ_ONLY)
        return
    if name not in DEFAULTS:
        autopilot.say(4, f"unknown param: {name}")
        _tell_fault(autopilot, source, name, _DOES_NOT_EXIST)
        return
    value = from_wire(message.param_type, message.param_value)
    fault, why = 0, ""
    if message.param_type != type_of(name):
        fault, why = _WRONG_TYPE, f"{name}: param types mismatch"
    elif value is None or (why := refusal(name, value)):
        fault = _READ_ONLY if DEFAULTS[name].fixed else _OUT_OF_RANGE
    if fault or value is None:
        autopilot.say(4, why)
        _tell_fault(autopilot, source, name, fault)
        _tell(autopilot, source[0], name)
        return
    autopilot.memory.parameters[name] = value
    autopilot.log.note_parameter(autopilot, name)
    for number in autopilot.memory.links:
        _tell(autopilot, number, name)


def _tell_fault(
    autopilot: Autopilot, source: Source, name: str, fault: int, index: int = -1
) -> None:
    """Sends PARAM_ERROR, which pymavlink has since 2025."""
    message = getattr(dialect(), "MAVLink_param_error_message", None)
    if message is not None:
        link, system, component = source
        autopilot.send(message(system, component, name.encode(), index, fault), link)


def _tell_check(autopilot: Autopilot, link: int) -> None:
    check = struct.pack("<I", check_of(autopilot.memory.parameters))
    message = dialect().MAVLink_param_value_message
    autopilot.send(
        message(CHECK.encode(), *struct.unpack("<f", check), UINT32, len(NAMES), 65535), link
    )


def _tell(autopilot: Autopilot, link: int, name: str) -> None:
    value = on_wire(name, autopilot.memory.parameters[name])
    message = dialect().MAVLink_param_value_message(
        name.encode(), value, type_of(name), len(NAMES), NAMES.index(name)
    )
    autopilot.send(message, link)
