"""The gripper: releases and grabs at once, without a payload.

A PX4 with a gripper answers IN_PROGRESS first, which MAVSDK 4.1 reports as an unknown result.
"""

from __future__ import annotations

import math

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.protocols.command_protocol import ACCEPTED, DENIED, Command
from volery.mavlink.autopilot.state import Source

DO_GRIPPER = 211
_ACTIONS = (0, 1)
"""GRIPPER_ACTIONS: release, grab."""


def act(_context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles DO_GRIPPER."""
    action = command.params[1]
    known = math.isfinite(action) and round(action) in _ACTIONS
    return ACCEPTED if known else DENIED
