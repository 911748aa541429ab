"""Answers MAVLink FTP like a server without files, so that clients do not wait for a timeout.

Header and answers follow `mavlink_ftp.cpp` of PX4 1.18.
"""

from __future__ import annotations

import struct
from typing import Any

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.state import Source
from volery.mavlink.codec import dialect

_HEADER = struct.Struct("<HBBBBBBI")
"""Sequence, session, opcode, size, answered opcode, end of a burst, padding, offset."""
_PAYLOAD = 251
_MAX_DATA_BYTES = _PAYLOAD - _HEADER.size
_ACK, _NAK = 128, 129
_FAIL, _INVALID_SIZE, _INVALID_SESSION, _UNKNOWN_COMMAND, _NOT_FOUND = 1, 3, 4, 7, 10
_FAULTS = {
    **dict.fromkeys((0, 2), 0),  # none, and terminate all sessions
    **dict.fromkeys((1, 5, 7, 15), _INVALID_SESSION),  # terminate, read, write, burst
    **dict.fromkeys((3, 4, 8, 10, 12, 13, 14, 16), _NOT_FOUND),  # operations on a path
    **dict.fromkeys((6, 9, 11), _FAIL),  # operations that create something
}
"""Error by opcode; 0: none."""


def answer_file_request(context: AutopilotContext, source: Source, message: Any) -> None:
    """Answers a FILE_TRANSFER_PROTOCOL message."""
    payload = bytes(message.payload)
    sequence, session, opcode, size, _, _, _, offset = _HEADER.unpack_from(payload)
    fault = _INVALID_SIZE if size > _MAX_DATA_BYTES else _FAULTS.get(opcode, _UNKNOWN_COMMAND)
    kind, data = (_NAK, bytes((fault,))) if fault else (_ACK, b"")
    head = _HEADER.pack(sequence + 1 & 0xFFFF, session, kind, len(data), opcode, 0, 0, offset)
    link, system, component = source
    message_class = dialect().MAVLink_file_transfer_protocol_message
    context.links.send(
        message_class(0, system, component, (head + data).ljust(_PAYLOAD, b"\0")), link
    )
