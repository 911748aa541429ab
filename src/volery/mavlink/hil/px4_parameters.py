"""Derives PX4's parameters for the airframe that it controls.

PX4's airframe 10016 (`none_iris`) describes an Iris; these parameters replace its geometry and its
hover throttle. Their names and ranges are those of PX4 1.18's modules control_allocator and
mc_pos_control. Rotor i has output i + 1, in the order of the airframe's file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from volery.core.errors import BridgeError
from volery.mavlink.autopilot.vehicle import Vector

MAX_ROTORS = 12
"""Largest number of rotors in PX4's control allocation."""
_MULTIROTOR = 0
_FIRST_MOTOR = 101
"""PX4's output function Motor 1."""
_HOVER_RANGE = (0.1, 0.8)
_TILT_RANGE = (20.0, 89.0)
_MAX_TORQUE_M = 1.0


class Px4Rotor(NamedTuple):
    """A rotor of the airframe."""

    position: Vector
    """Hub relative to the centre of mass, m, FLU."""
    axis: Vector
    """Direction of its thrust, FLU, unit length."""
    direction: str
    """`ccw` or `cw`, seen from above."""


class Px4Airframe(NamedTuple):
    """Properties of an airframe that PX4 needs."""

    rotors: Sequence[Px4Rotor]
    torque_m: float
    """Reaction torque per thrust of a rotor, m."""
    hover_speed_fraction: float
    """Rotor speed in hover over full speed, which is PX4's hover throttle: by default
    (`THR_MDL_FAC` 0) PX4 treats its outputs as thrust, and Volery treats them as speed."""
    tilt_deg: float
    """Largest tilt that controllers may command."""


def px4_parameters(airframe: Px4Airframe) -> Mapping[str, float]:
    """Returns PX4's parameters for an airframe; counts are `int`.

    Raises `BridgeError` for more than `MAX_ROTORS` rotors.
    """
    count = len(airframe.rotors)
    if count > MAX_ROTORS:
        raise BridgeError(f"an airframe of {count} rotors: PX4 can have at most {MAX_ROTORS}")
    found: dict[str, float] = {
        "CA_AIRFRAME": _MULTIROTOR,
        "CA_ROTOR_COUNT": count,
        "MPC_THR_HOVER": _within(airframe.hover_speed_fraction, _HOVER_RANGE),
        "MPC_TILTMAX_AIR": _within(airframe.tilt_deg, _TILT_RANGE),
    }
    torque_m = min(airframe.torque_m, _MAX_TORQUE_M)
    for i, rotor in enumerate(airframe.rotors):
        x, y, z = rotor.position
        ax, ay, az = rotor.axis
        values = {"PX": x, "PY": -y, "PZ": -z, "AX": ax, "AY": -ay, "AZ": -az}  # FLU to FRD
        values["KM"] = torque_m if rotor.direction == "ccw" else -torque_m
        found |= {f"CA_ROTOR{i}_{key}": round(value, 6) + 0.0 for key, value in values.items()}
        found[f"PWM_MAIN_FUNC{i + 1}"] = _FIRST_MOTOR + i
    return found


def _within(value: float, bounds: tuple[float, float]) -> float:
    return round(min(max(value, bounds[0]), bounds[1]), 4)
