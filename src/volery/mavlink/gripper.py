"""The gripper: it releases and grabs, as PX4's without a sensor, and carries nothing.

`payload_deliverer.cpp` of PX4 1.18: it starts grabbed; an action is IN_PROGRESS until its time is
over, another action cancels it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from volery.mavlink.acknowledgement import (
    ACCEPTED,
    CANCELLED,
    DENIED,
    IN_PROGRESS,
    TEMPORARILY_REJECTED,
    acknowledge,
)

if TYPE_CHECKING:
    from volery.mavlink.autopilot import Autopilot
    from volery.mavlink.commands import Command
    from volery.mavlink.memory import Source

DO_GRIPPER = 211
RELEASE, GRAB = 0, 1
"""GRIPPER_ACTIONS."""
_ACTION_NS = 1_000_000_000
"""Duration of an action (modelling choice)."""


def act(pilot: Autopilot, source: Source, command: Command) -> int:
    """Starts DO_GRIPPER's action."""
    gripper, action = pilot.memory.gripper, command.params[1]
    if not math.isfinite(action) or round(action) not in (RELEASE, GRAB):
        return DENIED
    wanted = round(action)
    if gripper.action is not None:
        if wanted == gripper.action:
            return TEMPORARILY_REJECTED
        if gripper.source is not None:
            acknowledge(pilot, gripper.source, DO_GRIPPER, CANCELLED)
    elif wanted == gripper.reached:
        return ACCEPTED
    gripper.action, gripper.source = wanted, source
    gripper.end_ns = pilot.memory.now_ns + _ACTION_NS
    return IN_PROGRESS


def update(pilot: Autopilot) -> None:
    """Ends an action whose time is over."""
    gripper = pilot.memory.gripper
    if gripper.action is None or pilot.memory.now_ns < gripper.end_ns:
        return
    gripper.reached, gripper.action = gripper.action, None
    if gripper.source is not None:
        acknowledge(pilot, gripper.source, DO_GRIPPER, ACCEPTED)
