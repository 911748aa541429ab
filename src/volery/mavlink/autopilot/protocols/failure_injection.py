"""Handles INJECT_FAILURE: injects the simulation's faults into the own UAV.

As in PX4, this needs SYS_FAILURE_EN = 1; an instance of a unit has one failure at most, and
FAILURE_TYPE_OK ends it (`FailureTable.cpp` of PX4 1.18). Faults injected by other clients stay.
"""

from __future__ import annotations

import math
from typing import Any

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.protocols.command_protocol import (
    ACCEPTED,
    DENIED,
    FAILED,
    UNSUPPORTED,
    Command,
)
from volery.mavlink.autopilot.state import Source

INJECT_FAILURE = 420
_GPS, _MOTOR = 4, 101
_SENSORS = {0: "imu", 1: "imu", 2: "mag", 3: "pressure", _GPS: "fix", 7: "range"}
"""Default name of the sensor by FAILURE_UNIT; gyroscope and accelerometer are one."""
_OK, _OFF, _STUCK = 0, 1, 2
"""Values of FAILURE_TYPE."""
_EFFECTS = {_OFF: "dropped", _STUCK: "stuck"}


def inject(context: AutopilotContext, _source: Source, command: Command) -> int:
    """Injects a failure of a unit of the UAV, or ends it."""
    unit, kind, instance = (
        round(part) if math.isfinite(part) else 0 for part in command.params[:3]
    )
    if context.parameter("SYS_FAILURE_EN") != 1:
        return DENIED
    instances = _instances_of(context, unit, instance)
    if not instances or not _is_supported(unit, kind):
        return UNSUPPORTED
    if unit == _GPS and kind in (_OK, _OFF) and not context.memory.has_receiver:
        context.memory.fix_denied = kind == _OFF
        return ACCEPTED
    for number in instances:
        why = _change(context, (unit, number), _fault_of(unit, kind, number))
        if why:
            context.report(4, why)
            return FAILED
    return ACCEPTED


def _is_supported(unit: int, kind: int) -> bool:
    """Returns whether a unit supports a kind of failure."""
    return kind in ((_OK, _OFF) if unit == _MOTOR else (_OK, _OFF, _STUCK))


def _instances_of(context: AutopilotContext, unit: int, instance: int) -> tuple[int, ...]:
    """Returns the instances of a unit, from 1, to which a command applies (0: all).

    The result is empty for missing units.
    """
    if unit == _MOTOR:
        all_of_them = tuple(range(1, context.build.rotors + 1))
    else:
        all_of_them = (1,) if unit in _SENSORS else ()
    return tuple(number for number in all_of_them if instance in (0, number))


def _fault_of(unit: int, kind: int, instance: int) -> dict[str, Any] | None:
    """Returns the fault of the simulation; None to end the failure."""
    if kind == _OK:
        return None
    if unit == _MOTOR:
        return {"kind": "motor", "rotor": instance - 1}
    if unit == _GPS and kind == _OFF:
        return {"kind": "gnss_loss"}
    return {"kind": "sensor", "sensor": _SENSORS[unit], "effect": _EFFECTS[kind]}


def _change(context: AutopilotContext, key: tuple[int, int], fault: dict[str, Any] | None) -> str:
    """Replaces the failure of an instance; returns why not, empty on success."""
    failures = context.memory.failures
    before = failures.pop(key, None)
    if before is not None:
        why = context.vehicle.end_fault(before)
        if why:
            return why
        for other in failures.values():  # another failure of the same sensor persists
            if other.get("sensor", "") == before.get("sensor"):
                context.vehicle.fail(other)
    if fault is None:
        return ""
    why = context.vehicle.fail(fault)
    if not why:
        failures[key] = fault
    return why
