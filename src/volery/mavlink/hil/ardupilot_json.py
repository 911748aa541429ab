"""ArduPilot's JSON interface for simulators: frames of outputs, lines of states, order of motors.

Follows ArduPilot's `libraries/SITL/SIM_JSON` (4.7-dev, 2025-12): servo outputs are little-endian
frames; a state is one line of JSON between line feeds. Its reader searches for keys as substrings
and reads the value two characters later, so that no blank may follow a colon.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from typing import NamedTuple

from volery.core.errors import BridgeError
from volery.core.frames import frd_of_flu, ned_of_enu, q_ned_frd_of_enu_flu
from volery.graph.rotor_layout import RotorLayout
from volery.mavlink.autopilot.vehicle import Quaternion, Vector

STATE_HZ = 800
"""ArduCopter's loop of 400 Hz begins with a state, and its pre-arm checks need 720 Hz or more."""
_AHEAD = 1.0 + 1e-8
"""Factor on times: its reader cuts what a state adds to its clock to whole microseconds: 1249 of
1249.99999998."""
_FRAMES = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}
"""Frame layouts of 16 and of 32 outputs, by their first number."""
_PWM_OFF, _PWM_FULL = 1000, 2000
"""Outputs of MOT_PWM_MIN and MOT_PWM_MAX of ArduPilot's simulations, microseconds."""
_FRAME_TYPES = {"X": (45.0, -135.0, -45.0, 135.0), "plus": (90.0, -90.0, 0.0, 180.0)}
"""Bearings of ArduCopter's motors 1 to 4, degrees clockwise from ahead."""
_TURNS = ("ccw", "ccw", "cw", "cw")
"""Turn directions of motors 1 to 4, seen from above."""
_NEAR_DEG = 22.5


class Servos(NamedTuple):
    """One frame of outputs."""

    rate_hz: int
    """State rate that ArduPilot requests; it accepts other rates, too."""
    number: int
    """Frame number from 0 at ArduPilot's start; a repeated number means that no state arrived."""
    pwm: tuple[int, ...]
    """Outputs, microseconds; 0: no output."""


class State(NamedTuple):
    """State of a UAV. FLU, map, SI; None: not measured."""

    force: Vector
    rates: Vector
    position: Vector
    attitude: Quaternion
    velocity: Vector
    range_m: float | None = None
    battery: tuple[float, float] | None = None
    """Voltage, V, and current, A."""


def parse_servos(data: bytes) -> Servos | None:
    """Returns the outputs in a datagram; None if the datagram holds none."""
    if len(data) < 2:
        return None
    frame = _FRAMES.get(int.from_bytes(data[:2], "little"))
    if frame is None or len(data) != frame.size:
        return None
    _, rate, number, *pwm = frame.unpack(data)
    return Servos(rate, number, tuple(pwm))


def state_line(time_s: float, state: State) -> bytes:
    """Returns the line of a state at a time of the simulator's clock."""
    x, y, z, w = q_ned_frd_of_enu_flu(state.attitude)
    fields: dict[str, object] = {
        "timestamp": time_s * _AHEAD,
        "imu": {"gyro": frd_of_flu(state.rates), "accel_body": frd_of_flu(state.force)},
        "position": ned_of_enu(state.position),
        "quaternion": (w, x, y, z),
        "velocity": ned_of_enu(state.velocity),
    }
    if state.range_m is not None:
        fields["rng_1"] = state.range_m
    if state.battery is not None:
        fields["battery"] = {"voltage": state.battery[0], "current": state.battery[1]}
    return b"\n" + json.dumps(fields, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def motors_of(rotors: RotorLayout) -> tuple[int, ...]:
    """Returns the index of ArduCopter's output, from 0, for each rotor of a quadrotor.

    Arms as an X are its FRAME_TYPE 1, arms as a plus 0. Raises `BridgeError` for other shapes and
    for rotors that turn the other way.
    """
    bearings = [math.degrees(math.atan2(-rotor.y, rotor.x)) for rotor in rotors]
    for motors in _FRAME_TYPES.values():
        found = [_nearest(bearing, motors) for bearing in bearings]
        if sorted(found) == [0, 1, 2, 3]:
            if all(_TURNS[k] == r.direction for k, r in zip(found, rotors, strict=True)):
                return tuple(found)
            raise BridgeError("its rotors turn opposite to ArduCopter's motors")
    raise BridgeError("ArduCopter flies quadrotors with arms as an X or a plus here")


def rotor_fractions(pwm: Sequence[int], motors: Sequence[int]) -> list[float]:
    """Returns each rotor's fraction of full speed."""
    span = _PWM_FULL - _PWM_OFF
    return [min(max((pwm[k] - _PWM_OFF) / span, 0.0), 1.0) for k in motors]


def _nearest(bearing: float, motors: Sequence[float]) -> int:
    """Returns the motor within `_NEAR_DEG` of a bearing; -1 if there is none."""
    for k, motor_bearing in enumerate(motors):
        if abs((bearing - motor_bearing + 180.0) % 360.0 - 180.0) < _NEAR_DEG:
            return k
    return -1
