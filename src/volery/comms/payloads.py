"""Payloads of messages between stations: a named message of the graph.

Payload of COMMAND and SENSING: text name · text type · CDR with its four bytes of header; `text` is
a u8 length and so many bytes of UTF-8. The name is the topic or service name below the UAV's; those
of Volery's stations are in docs/comms.md. Programs may send any other message of the graph under
another name.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from volery.core.errors import CommsError, GraphError
from volery.graph.codecs.cdr import decode_cdr, encode_cdr

STATE, STATE_TYPE = "state", "volery_interfaces/msg/VehicleState"
MISSION, MISSION_TYPE = "mission", "volery_interfaces/msg/MissionStatus"
SLAM, SLAM_TYPE = "slam", "std_msgs/msg/String"
REPLY, REPLY_TYPE = "reply", "std_msgs/msg/String"
_TRIGGER = "std_srvs/srv/Trigger"
COMMANDS = {
    "take_off": _TRIGGER,
    "take_off_to": "volery_interfaces/srv/TakeOffTo",
    "land": _TRIGGER,
    "hold": _TRIGGER,
    "return_home": _TRIGGER,
    "resume": _TRIGGER,
    "go_to": "volery_interfaces/srv/GoTo",
}
"""Services of a UAV that stations may call, and their types."""
MISSION_COMMANDS = frozenset({"land", "hold", "return_home", "resume"})
"""Services of its mission, if it has one; `resume` exists for missions only."""

_LONGEST_TEXT_BYTES = 255


class Named(NamedTuple):
    """A message of the graph with its name."""

    name: str
    msgtype: str
    message: Any


def encode_named(name: str, msgtype: str, message: Any) -> bytes:
    """Returns the payload of a message.

    Raises
    ------
    CommsError
        A name is too long, or the message does not fit its type.

    """
    texts = [text.encode() for text in (name, msgtype)]
    if max(map(len, texts)) > _LONGEST_TEXT_BYTES:
        raise CommsError(f"'{name[:40]}': names have {_LONGEST_TEXT_BYTES} bytes at most")
    try:
        cdr = encode_cdr(message, msgtype)
    except GraphError as error:
        raise CommsError(str(error)) from None
    return b"".join(bytes((len(text),)) + text for text in texts) + cdr


def decode_named(payload: bytes) -> Named:
    """Returns the message of a payload. Raises CommsError if it is invalid."""
    try:
        texts, rest = [], payload
        for _ in range(2):
            end = 1 + rest[0]
            texts.append(rest[1:end].decode())
            rest = rest[end:]
        return Named(texts[0], texts[1], decode_cdr(rest, texts[1]))
    except (IndexError, UnicodeDecodeError, GraphError) as error:
        raise CommsError(f"not a message of the graph: {error}") from None
