"""A command of a client, and its result, which COMMAND_ACK reports."""

from __future__ import annotations

from typing import NamedTuple

from volery.mavlink.autopilot.client_links import ClientLinks
from volery.mavlink.autopilot.state import Source
from volery.mavlink.codec import dialect

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
UNSUPPORTED_FRAME = 9
"""Values of MAV_RESULT."""


class Command(NamedTuple):
    """A command with seven parameters; frame: of a COMMAND_INT."""

    number: int
    params: tuple[float, ...]
    frame: int | None


def acknowledge(links: ClientLinks, source: Source, command: int, result: int) -> None:
    """Sends the result of a command to its sender."""
    link, system, component = source
    progress = 0  # PX4's, where the protocol would have 255
    ack = dialect().MAVLink_command_ack_message
    links.send(ack(command, result, progress, 0, system, component), link)
