"""INJECT_FAILURE: the faults of the simulation under MAVLink's numbers, for the own UAV alone.

As in PX4 only where SYS_FAILURE_EN is 1. An injected fault stays, but for that of satellite fixes
of a UAV without a receiver, which FAILURE_TYPE_OK ends.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from volery.mavlink.acknowledgement import ACCEPTED, DENIED, FAILED, UNSUPPORTED

if TYPE_CHECKING:
    from volery.mavlink.autopilot import Autopilot
    from volery.mavlink.commands import Command
    from volery.mavlink.memory import Source

INJECT_FAILURE = 420
_GPS, _MOTOR = 4, 101
_SENSORS = {0: "imu", 1: "imu", 2: "mag", 3: "pressure", _GPS: "fix", 7: "range"}
"""Usual name of the sensor by FAILURE_UNIT; gyroscope and accelerometer are one."""
_OK, _OFF, _STUCK = 0, 1, 2
"""FAILURE_TYPE."""
_EFFECTS = {_OFF: "dropped", _STUCK: "stuck"}


def inject(pilot: Autopilot, _source: Source, command: Command) -> int:
    """Lets a unit of the UAV fail."""
    unit, kind, instance = (
        round(part) if math.isfinite(part) else 0 for part in command.params[:3]
    )
    if pilot.parameter("SYS_FAILURE_EN") != 1:
        return DENIED
    if unit == _GPS and kind in (_OK, _OFF) and not pilot.memory.has_receiver:
        pilot.memory.fix_denied = kind == _OFF
        return ACCEPTED
    faults = _faults_of(pilot, unit, kind, instance)
    for fault in faults:
        why = pilot.vehicle.fail(fault)
        if why:
            pilot.say(4, why)
            return FAILED
    return ACCEPTED if faults else UNSUPPORTED


def _faults_of(pilot: Autopilot, unit: int, kind: int, instance: int) -> list[dict[str, Any]]:
    """Returns the faults of a failure; none where there is no such fault."""
    rotors = pilot.build.rotors
    if unit == _MOTOR and kind == _OFF and 0 <= instance <= rotors:
        chosen = range(rotors) if instance == 0 else (instance - 1,)
        return [{"kind": "motor", "rotor": rotor} for rotor in chosen]
    if unit == _GPS and kind == _OFF and instance <= 1:
        return [{"kind": "gnss_loss"}]
    if unit in _SENSORS and kind in _EFFECTS and instance <= 1:
        return [{"kind": "sensor", "sensor": _SENSORS[unit], "effect": _EFFECTS[kind]}]
    return []
