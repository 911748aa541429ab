"""Requirements of modes on other clients: manual control, setpoints, a mission."""

from __future__ import annotations

from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.protocols import plans
from volery.mavlink.autopilot.state import AutopilotState

_MIN_OFFBOARD_HZ = 2.0
"""Setpoint rate above which PX4 enters offboard."""


def missing(memory: AutopilotState, mode: Mode) -> str:
    """Returns what a mode lacks; empty if nothing is missing."""
    if mode.by_sticks and not sticks_are_there(memory):
        return "no manual control input"
    if mode is Mode.OFFBOARD and not offboard_is_fresh(memory):
        return "no offboard signal"
    if mode is Mode.ORBIT and memory.orbit is None:
        return "no orbit was asked for"
    if mode is Mode.MISSION and not memory.plans[plans.MISSION]:
        return "no valid mission"
    return ""


def sticks_are_there(memory: AutopilotState) -> bool:
    """Returns whether MANUAL_CONTROL has arrived within COM_RC_LOSS_T."""
    age_ns = memory.now_ns - memory.sticks.time_ns
    return age_ns <= float(memory.parameters["COM_RC_LOSS_T"]) * 1e9


def offboard_is_fresh(memory: AutopilotState) -> bool:
    """Returns whether setpoints arrive often enough."""
    offboard, now_ns = memory.offboard, memory.now_ns
    return offboard.setpoint is not None and now_ns - offboard.time_ns < 1e9 / _MIN_OFFBOARD_HZ


def ground_is_there(memory: AutopilotState) -> bool:
    """Returns whether a ground station's heartbeat has arrived within COM_DL_LOSS_T."""
    heartbeat_ns = memory.ground_heartbeat_ns
    limit_ns = int(memory.parameters["COM_DL_LOSS_T"]) * 1_000_000_000
    return heartbeat_ns >= 0 and memory.now_ns - heartbeat_ns <= limit_ns
