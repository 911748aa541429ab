"""ArduPilot's JSON interface for simulators: what it sends, what it reads, which motor is which.

As of ArduPilot's `libraries/SITL/SIM_JSON` (4.7-dev, 2025-12): servo outputs come as little-endian
frames, a state goes back as one line of JSON between line feeds. Its reader looks for keys as
substrings and takes what follows two characters later, so that no blank may stand after a colon.
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
"""ArduCopter's loop of 400 Hz begins with a state, and its pre-arm checks want 720 Hz or more."""
_AHEAD = 1.0 + 1e-8
"""Its reader cuts what a state adds to its clock to whole microseconds: 1249 of 1249.99999998."""
_FRAMES = {18458: struct.Struct("<HHI16H"), 29569: struct.Struct("<HHI32H")}
"""By their first number: frames of 16 and of 32 outputs."""
_PWM_OFF, _PWM_FULL = 1000, 2000
"""microseconds: MOT_PWM_MIN and MOT_PWM_MAX of ArduPilot's simulations."""
_FRAME_TYPES = {"X": (45.0, -135.0, -45.0, 135.0), "plus": (90.0, -90.0, 0.0, 180.0)}
"""degrees clockwise from ahead of ArduCopter's motors 1 to 4."""
_TURNS = ("ccw", "ccw", "cw", "cw")
"""Seen from above, of motors 1 to 4."""
_NEAR_DEG = 22.5


class Servos(NamedTuple):
    """One frame of outputs."""

    rate_hz: int
    """At which ArduPilot would like to be told; it takes other rates, too."""
    number: int
    """Counts from 0 at its start; one that comes again was not answered."""
    pwm: tuple[int, ...]
    """microseconds; 0: no output."""


class State(NamedTuple):
    """What is told of a UAV. FLU, map, SI; None: not measured."""

    force: Vector
    rates: Vector
    position: Vector
    attitude: Quaternion
    velocity: Vector
    range_m: float | None = None
    battery: tuple[float, float] | None = None
    """V, A."""


def parse_servos(data: bytes) -> Servos | None:
    """The outputs in a datagram; None where it is something else."""
    if len(data) < 2:
        return None
    frame = _FRAMES.get(int.from_bytes(data[:2], "little"))
    if frame is None or len(data) != frame.size:
        return None
    _, rate, number, *pwm = frame.unpack(data)
    return Servos(rate, number, tuple(pwm))


def state_line(time_s: float, state: State) -> bytes:
    """The line that tells a state at a time of the simulator's clock."""
    x, y, z, w = q_ned_frd_of_enu_flu(state.attitude)
    told: dict[str, object] = {
        "timestamp": time_s * _AHEAD,
        "imu": {"gyro": frd_of_flu(state.rates), "accel_body": frd_of_flu(state.force)},
        "position": ned_of_enu(state.position),
        "quaternion": (w, x, y, z),
        "velocity": ned_of_enu(state.velocity),
    }
    if state.range_m is not None:
        told["rng_1"] = state.range_m
    if state.battery is not None:
        told["battery"] = {"voltage": state.battery[0], "current": state.battery[1]}
    return b"\n" + json.dumps(told, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def motors_of(rotors: RotorLayout) -> tuple[int, ...]:
    """Which of ArduCopter's outputs, from 0, turns each rotor of a quadrotor.

    Arms as an X are its FRAME_TYPE 1, arms as a plus 0. `BridgeError` for any other shape, and for
    rotors that turn the other way.
    """
    bearings = [math.degrees(math.atan2(-rotor.y, rotor.x)) for rotor in rotors]
    for motors in _FRAME_TYPES.values():
        found = [_nearest(bearing, motors) for bearing in bearings]
        if sorted(found) == [0, 1, 2, 3]:
            if all(_TURNS[k] == r.direction for k, r in zip(found, rotors, strict=True)):
                return tuple(found)
            raise BridgeError("its rotors turn the other way than ArduCopter's motors do")
    raise BridgeError("ArduCopter flies quadrotors with arms as an X or a plus here")


def shares(pwm: Sequence[int], motors: Sequence[int]) -> list[float]:
    """Share of full speed for each rotor."""
    span = _PWM_FULL - _PWM_OFF
    return [min(max((pwm[k] - _PWM_OFF) / span, 0.0), 1.0) for k in motors]


def _nearest(bearing: float, motors: Sequence[float]) -> int:
    """The motor within `_NEAR_DEG` of a bearing; -1 where there is none."""
    for k, place in enumerate(motors):
        if abs((bearing - place + 180.0) % 360.0 - 180.0) < _NEAR_DEG:
            return k
    return -1
