"""COMMAND_ACK: the results of commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

from volery.mavlink.codec import dialect

if TYPE_CHECKING:
    from volery.mavlink.autopilot import Autopilot
    from volery.mavlink.memory import Source

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS = 0, 1, 2, 3, 4, 5
CANCELLED = 6
"""MAV_RESULT."""
_UNKNOWN_PROGRESS = 255


def acknowledge(pilot: Autopilot, source: Source, command: int, result: int) -> None:
    """Sends the result of a command to its sender."""
    link, system, component = source
    progress = _UNKNOWN_PROGRESS if result == IN_PROGRESS else 0  # 0 is PX4's, not the protocol's
    ack = dialect().MAVLink_command_ack_message
    pilot.send(ack(command, result, progress, 0, system, component), link)
