"""Sends the results of commands as COMMAND_ACK."""

from __future__ import annotations

from typing import TYPE_CHECKING

from volery.mavlink.codec import dialect

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot
    from volery.mavlink.autopilot.state import Source

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
"""Values of MAV_RESULT."""


def acknowledge(autopilot: Autopilot, source: Source, command: int, result: int) -> None:
    """Sends the result of a command to its sender."""
    link, system, component = source
    progress = 0  # PX4's, where the protocol would have 255
    ack = dialect().MAVLink_command_ack_message
    autopilot.send(ack(command, result, progress, 0, system, component), link)
