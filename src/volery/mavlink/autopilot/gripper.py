"""The gripper: releases and grabs at once, without a payload.

A PX4 with a gripper answers IN_PROGRESS first, which MAVSDK 4.1 reports as an unknown result.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from volery.mavlink.autopilot.acknowledgement import ACCEPTED, DENIED

if TYPE_CHECKING:
    from volery.mavlink.autopilot.commands import Command
    from volery.mavlink.autopilot.core import Autopilot
    from volery.mavlink.autopilot.state import Source

DO_GRIPPER = 211
_ACTIONS = (0, 1)
"""GRIPPER_ACTIONS: release, grab."""


def act(_autopilot: Autopilot, _source: Source, command: Command) -> int:
    """Handles DO_GRIPPER."""
    action = command.params[1]
    known = math.isfinite(action) and round(action) in _ACTIONS
    return ACCEPTED if known else DENIED
