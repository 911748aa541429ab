"""Setpoints of the controllers: one record per UAV, from flight mode down to rotor speeds.

Each layer reads its setpoint and writes that of the layer below. A command enters at its own layer,
which `ControlLevel` names; the layers above are inactive.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.core.arrays import Array
from volery.core.errors import CommandError
from volery.vehicle.airframe import MAX_ROTORS

MAX_COORDINATE = 1e6
"""Maximum distance of positions from the map's origin, m."""


class ControlLevel(IntEnum):
    """The layer at which a UAV receives commands."""

    STOPPED = 0
    """Rotors are stopped."""
    ROTORS = 1
    """Speeds of the rotors."""
    RATES = 2
    """Body rates and thrust."""
    ATTITUDE = 3
    """Attitude and thrust."""
    GUIDED = 4
    """Velocity, position, trajectory or a flight mode."""
    POSE = 5
    """Pose of a kinematic UAV, set externally."""


CONTROL_STATE = np.dtype(
    [
        # fields of every step, adjacent for the cache
        ("mode", "i8"),  # flight_modes.FlightMode
        ("level", "i8"),  # ControlLevel
        ("velocity_in_heading", "?"),  # velocity_target turns with the vehicle's heading
        ("braking", "?"),  # HOLD and LAND: stop first, then lock the position
        ("turning", "?"),  # heading follows yaw_rate_target instead of heading_target
        ("saturated", "?"),  # the rotors could not provide the last torque
        ("path_faces", "?"),  # the trajectory has headings
        ("errs", "?"),  # controllers use an estimate, see control.estimated_state
        ("hurried", "?"),  # stop command: guided with the next step instead of the next tick
        ("spare", "u1", 1),  # no hidden padding: equal states are equal bytes
        ("thrust", "f8"),  # N along the body's z
        ("yaw_rate", "f8"),  # rad/s, fed forward to the rates
        ("full_thrust", "f8"),  # N: maximum of one rotor at the battery's present voltage
        ("rates", "f8", 3),  # rad/s, FLU
        ("rate_integral", "f8", 3),  # rad/s^2
        ("rotor_reference", "f8", MAX_ROTORS),  # rad/s
        # state of guidance and attitude
        ("phase", "i8"),  # of a flight mode that has several
        ("calm_ticks", "i8"),  # guidance ticks for which a condition of the mode has held
        ("deadline_step", "i8"),  # the setpoint holds, or a landing brakes, until this step
        ("timeout_steps", "i8"),  # ... and is renewed by this many
        ("start_step", "i8"),  # when a trajectory or a trajectory setpoint began
        ("path_first", "i8"),  # rows of the trajectory's segments; of none: 0, -1
        ("path_last", "i8"),
        ("path_row", "i8"),  # the segment flown now
        ("home", "f8", 3),  # m, map: start of the last take-off
        ("return_height", "f8"),  # m, map
        ("sink", "f8"),  # m/s at which LAND descends; 0: the airframe's own speed
        ("position_target", "f8", 3),  # m, map
        ("velocity_target", "f8", 3),  # m/s, map or heading frame
        ("acceleration_target", "f8", 3),  # m/s^2, map
        ("heading_target", "f8", 2),  # cosine and sine
        ("yaw_rate_target", "f8"),  # rad/s
        ("heading", "f8", 2),  # setpoint moving towards its target, cosine and sine
        ("position", "f8", 3),  # m, map: reference of the outer loop, moving towards its target
        ("velocity", "f8", 3),  # m/s, map: of the reference
        ("acceleration", "f8", 3),  # m/s^2, map: of the reference
        ("velocity_integral", "f8", 3),  # m/s^2, map: against steady disturbances
        ("attitude", "f8", 4),  # map from body
        ("rotor_target", "f8", MAX_ROTORS),  # rad/s, where speeds are commanded
        ("pose_stamp", "i8"),  # ns, of the last external pose; -1: it had none
        ("pose_steps", "i8"),  # steps until an external motion has its velocity; 0: a jump
    ],
    align=True,
)
"""Commands, setpoints and controller states of one UAV; fields of every step are adjacent."""


def new_control_states(attitude: Array) -> NDArray[np.void]:
    """Returns control states (N,) of UAVs at rest with `attitude` (N, 4)."""
    control_states = np.zeros(len(attitude), CONTROL_STATE)
    control_states["path_last"] = -1
    control_states["attitude"] = attitude
    x, y, z, w = attitude.T
    heading = np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (w * z + x * y)], axis=-1)
    length = np.linalg.norm(heading, axis=-1, keepdims=True)
    heading = np.where(length > 1e-6, heading / np.maximum(length, 1e-6), [1.0, 0.0])
    control_states["heading"] = control_states["heading_target"] = heading
    return control_states


def checked(what: str, value: ArrayLike, shape: tuple[int, ...], limit: float) -> Array:
    """Returns `value` as finite floats of `shape` within +-`limit`, or raises `CommandError`."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise CommandError(f"{what} must be numbers") from None
    if array.shape != shape:
        raise CommandError(f"{what} must have shape {shape}, not {array.shape}")
    if not np.isfinite(array).all():
        raise CommandError(f"{what} = {_shown(array)} is not finite")
    if (np.abs(array) > limit).any():
        raise CommandError(f"{what} = {_shown(array)} is out of range; +-{limit:.6g} is allowed")
    return array


def checked_within(what: str, value: ArrayLike, shape: tuple[int, ...], high: float) -> Array:
    """Returns numbers from 0 to `high`, checked as by `checked`."""
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and value.shape == shape:
        low, top = value.min(initial=0.0), value.max(initial=0.0)
        if low >= 0.0 and top <= high:  # false for nan; the checks below raise the error
            return value
    array = checked(what, value, shape, math.inf)
    if (array < 0.0).any() or (array > high).any():
        raise CommandError(
            f"{what} = {_shown(array)} is out of range; from 0 to {high:.6g} is allowed"
        )
    return array


def checked_attitude(value: ArrayLike) -> Array:
    """Returns the unit quaternion (4,) of a command; normalises lengths between 0.9 and 1.1."""
    q = checked("attitude", value, (4,), 1.1)
    length = float(np.linalg.norm(q))
    if not 0.9 <= length <= 1.1:
        raise CommandError(f"attitude has length {length:.3g}; a unit quaternion is needed")
    return np.asarray(q / length)


def _shown(array: Array) -> Any:
    return array.tolist()
