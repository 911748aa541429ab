"""The parameter protocol, as PX4 speaks it."""

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
"""MAV_PARAM_ERROR."""
A_TICK = 2
"""Values that a list sends at each state of the vehicle: 200 a second, no burst for slow lines."""


def send_list(pilot: Autopilot, source: Source, _message: Any) -> None:
    """Begin to send all values on the link, their check first."""
    _tell_check(pilot, source[0])
    pilot.memory.links[source[0]].parameters_to_send = list(reversed(range(len(NAMES))))


def send_some(pilot: Autopilot, link: LinkState) -> None:
    """Go on with a list."""
    for _ in range(min(A_TICK, len(link.parameters_to_send))):
        _tell(pilot, link.number, NAMES[link.parameters_to_send.pop()])


def send_one(pilot: Autopilot, source: Source, message: Any) -> None:
    """Answer a PARAM_REQUEST_READ; of a parameter that is not there with PARAM_ERROR."""
    name, index = message.param_id, message.param_index
    if 0 <= index < len(NAMES):
        name = NAMES[index]
    if index < 0 and name == CHECK:
        _tell_check(pilot, source[0])
    elif index < len(NAMES) and name in DEFAULTS:
        _tell(pilot, source[0], name)
    else:
        _tell_fault(pilot, source, "" if index >= 0 else name, _DOES_NOT_EXIST, index)


def set_one(pilot: Autopilot, source: Source, message: Any) -> None:
    """Set a parameter and tell all links; of what is refused, why, and the value that holds."""
    name = message.param_id
    if name == CHECK:  # whose list is up to date asks for an end of it
        pilot.memory.links[source[0]].parameters_to_send = []
        _tell_fault(pilot, source, name, _READ_ONLY)
        return
    if name not in DEFAULTS:
        pilot.say(4, f"unknown param: {name}")
        _tell_fault(pilot, source, name, _DOES_NOT_EXIST)
        return
    value = from_wire(message.param_type, message.param_value)
    fault, why = 0, ""
    if message.param_type != type_of(name):
        fault, why = _WRONG_TYPE, f"{name}: param types mismatch"
    elif value is None or (why := refusal(name, value)):
        fault = _READ_ONLY if DEFAULTS[name].fixed else _OUT_OF_RANGE
    if fault or value is None:
        pilot.say(4, why)
        _tell_fault(pilot, source, name, fault)
        _tell(pilot, source[0], name)
        return
    pilot.memory.parameters[name] = value
    pilot.log.note_parameter(pilot, name)
    for number in pilot.memory.links:
        _tell(pilot, number, name)


def _tell_fault(pilot: Autopilot, source: Source, name: str, fault: int, index: int = -1) -> None:
    """PARAM_ERROR, which pymavlink has since 2025."""
    message = getattr(dialect(), "MAVLink_param_error_message", None)
    if message is not None:
        link, system, component = source
        pilot.send(message(system, component, name.encode(), index, fault), link)


def _tell_check(pilot: Autopilot, link: int) -> None:
    check = struct.pack("<I", check_of(pilot.memory.parameters))
    message = dialect().MAVLink_param_value_message
    pilot.send(
        message(CHECK.encode(), *struct.unpack("<f", check), UINT32, len(NAMES), 65535), link
    )


def _tell(pilot: Autopilot, link: int, name: str) -> None:
    value = on_wire(name, pilot.memory.parameters[name])
    message = dialect().MAVLink_param_value_message(
        name.encode(), value, type_of(name), len(NAMES), NAMES.index(name)
    )
    pilot.send(message, link)
