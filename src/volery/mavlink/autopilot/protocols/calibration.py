"""Calibration of sensors: starts and ends like PX4's, without an effect.

The simulated sensors of a UAV at rest need no calibration. The STATUSTEXTs that ground stations
parse follow `calibration_messages.h` of PX4 1.18. Calibrations that turn the vehicle by hand
(magnetometer, accelerometer on six sides) and those of missing sensors (radio, airspeed) are not
supported.
"""

from __future__ import annotations

import math

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.protocols.command_protocol import (
    ACCEPTED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    Command,
)
from volery.mavlink.autopilot.state import Calibration, Source

CALIBRATE = 241
_OFFERED: dict[tuple[float, ...], str] = {
    (1, 0, 0, 0, 0): "gyro",
    (0, 0, 1, 0, 0): "baro",
    (0, 0, 0, 0, 2): "level",
    (0, 0, 0, 0, 4): "accel",
}
"""Sensor by the first five parameters of the command."""
_DURATION_NS = 2_000_000_000
_STEP_PERCENT = 5
"""The duration is a modelling choice, the step is PX4's."""


def start(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Handles PREFLIGHT_CALIBRATION; without a sensor it cancels the current calibration."""
    memory = context.memory
    params = [0.0 if math.isnan(param) else param for param in command.params]
    if not any(params):
        if memory.calibration is not None:
            memory.calibration = None
            context.report(6, "[cal] calibration cancelled")
        return ACCEPTED
    if memory.armed or memory.calibration is not None or context.state.mode != "LANDED":
        return TEMPORARILY_REJECTED
    sensor = _OFFERED.get(tuple(params[:5])) if not any(params[5:]) else None
    if sensor is None:
        return UNSUPPORTED
    memory.calibration = Calibration(sensor, memory.now_ns)
    return ACCEPTED


def update(context: AutopilotContext) -> None:
    """Reports the progress of a calibration."""
    memory, calibration = context.memory, context.memory.calibration
    if calibration is None:
        return
    if calibration.percent < 0:
        context.report(6, f"[cal] calibration started: 2 {calibration.sensor}")
        calibration.percent = 0
    if memory.armed or context.state.mode != "LANDED":
        memory.calibration = None
        context.report(2, f"[cal] calibration failed: {calibration.sensor}")
        return
    percent = min((memory.now_ns - calibration.start_ns) * 100 // _DURATION_NS, 100)
    while calibration.percent + _STEP_PERCENT <= percent:
        calibration.percent += _STEP_PERCENT
        context.report(6, f"[cal] progress <{calibration.percent}>")
    if calibration.percent == 100:
        memory.calibration = None
        context.report(6, f"[cal] calibration done: {calibration.sensor}")
