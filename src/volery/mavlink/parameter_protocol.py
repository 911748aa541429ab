"""The parameter protocol, as PX4 speaks it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from volery.mavlink.codec import dialect
from volery.mavlink.parameters import DEFAULTS, NAMES, from_wire, on_wire, refusal, type_of

if TYPE_CHECKING:
    from volery.mavlink.autopilot import Autopilot
    from volery.mavlink.memory import Link, Source

A_TICK = 2
"""Values that a list sends at each state of the vehicle: 200 a second, no burst for slow lines."""


def send_list(pilot: Autopilot, source: Source, _message: Any) -> None:
    """Begin to send all values on the link."""
    pilot.memory.links[source[0]].parameters_to_send = list(reversed(range(len(NAMES))))


def send_some(pilot: Autopilot, link: Link) -> None:
    """Go on with a list."""
    for _ in range(min(A_TICK, len(link.parameters_to_send))):
        _tell(pilot, link.number, NAMES[link.parameters_to_send.pop()])


def send_one(pilot: Autopilot, source: Source, message: Any) -> None:
    """Answer a PARAM_REQUEST_READ; of parameters that are not there nobody tells."""
    name = message.param_id
    if 0 <= message.param_index < len(NAMES):
        name = NAMES[message.param_index]
    if message.param_index < len(NAMES) and name in DEFAULTS:
        _tell(pilot, source[0], name)


def set_one(pilot: Autopilot, source: Source, message: Any) -> None:
    """Set a parameter, tell all links its value; of what is refused, the value that holds."""
    name = message.param_id
    if name not in DEFAULTS:
        pilot.say(4, f"unknown param: {name}")
        return
    value = from_wire(message.param_type, message.param_value)
    why = "" if message.param_type == type_of(name) else f"{name}: param types mismatch"
    why = why or refusal(name, 0.0 if value is None else value)
    if why:
        pilot.say(4, why)
        _tell(pilot, source[0], name)
        return
    assert value is not None
    pilot.memory.parameters[name] = value
    for number in pilot.memory.links:
        _tell(pilot, number, name)


def _tell(pilot: Autopilot, link: int, name: str) -> None:
    value = on_wire(name, pilot.memory.parameters[name])
    message = dialect().MAVLink_param_value_message(
        name.encode(), value, type_of(name), len(NAMES), NAMES.index(name)
    )
    pilot.send(message, link)
