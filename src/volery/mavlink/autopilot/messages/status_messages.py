"""Builds the messages that the autopilot sends at each change: HEARTBEAT and STATUSTEXT."""

from __future__ import annotations

from typing import Any

from volery.mavlink.autopilot.state import AutopilotState
from volery.mavlink.codec import dialect

_PX4 = 12
"""Value MAV_AUTOPILOT_PX4."""
_CHUNK = 50
"""Characters of a STATUSTEXT."""
_MAX_CHUNKS = 256
"""Chunks that `chunk_seq` can number."""


def heartbeat(memory: AutopilotState) -> Any:
    """Returns HEARTBEAT: mode, armed, system status."""
    base = 1 | memory.mode.flags | (128 if memory.armed else 0)
    status = 4 if memory.armed else 3
    if memory.failsafe:
        status = 5
    if memory.state is not None and memory.state.crashed:
        status = 6
    kind = int(memory.parameters["MAV_TYPE"])
    return dialect().MAVLink_heartbeat_message(kind, _PX4, base, memory.mode.custom_mode, status, 3)


def status_texts(severity: int, text: str, number: int) -> list[Any]:
    """Returns the STATUSTEXT messages of a text: chunks with the id `number` if it is long.

    A receiver that joins chunks knows the last one by its NUL, so that one is never full.
    """
    raw = text.replace("\0", "?").encode("ascii", "replace")[: _MAX_CHUNKS * _CHUNK - 1]
    status = dialect().MAVLink_statustext_message
    if len(raw) <= _CHUNK:
        return [status(severity, raw, 0, 0)]
    pieces = [raw[k : k + _CHUNK] for k in range(0, len(raw) + 1, _CHUNK)]
    return [status(severity, piece, number, k) for k, piece in enumerate(pieces)]
