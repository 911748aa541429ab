"""The identified plant: closed loops of attitude and thrust, as measured in flight.

The model of the ROSUnitySim platform: with its inner controllers a vehicle responds to attitude and
thrust setpoints as first- or second-order systems with gain and dead time. A file holds their
parameters; `volery identify` makes one. Roll and pitch turn about the body's x and y axes, which
for small angles equals Euler angles, without their singularity. Thrust tilts with the vehicle and
moves it with gravity and a linear drag along the body's axes:

    v' = R (0, 0, T/m) - R D R^T (v - wind) - g

Each loop is stepped by its exact solution over a physics step.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from volery.core.arrays import Array
from volery.scenario.data_files import find_data_file, load_data_file
from volery.vehicle.airframe import GRAVITY, Airframe
from volery.vehicle.compiled import inner_kernel
from volery.vehicle.rotation_math import four, matrix_of, nudged, three

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Gain = Annotated[float, Field(gt=0.0, le=2.0)]
DeadTime = Annotated[float, Field(ge=0.0, le=0.25)]

_MODELS = Path(__file__).parent / "identified"
REFERENCE_COLUMNS = 6
"""Columns of each past step: attitude setpoint (4), thrust and yaw rate."""


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class FirstOrder(_Table):
    """gain / (tau s + 1)."""

    kind: Literal["first_order"]
    time_constant_s: Positive
    gain: Gain = 1.0


class SecondOrder(_Table):
    """gain w^2 / (s^2 + 2 zeta w s + w^2)."""

    kind: Literal["second_order"]
    natural_frequency_rad_s: Positive
    damping: Positive
    gain: Gain = 1.0


Loop = Annotated[FirstOrder | SecondOrder, Field(discriminator="kind")]


class Heave(_Table):
    """Thrust: gain / (tau s + 1), and its dead time."""

    time_constant_s: Positive
    gain: Gain = 1.0
    dead_time_s: DeadTime = 0.0


class FitError(_Table):
    """Root mean square errors on flights that were not used for the fit."""

    attitude_deg: NotNegative
    yaw_deg: NotNegative
    vertical_acceleration_m_s2: NotNegative
    velocity_m_s: NotNegative


class IdentifiedModel(_Table):
    """Closed loops of one vehicle from setpoints to true attitude and thrust."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9_]+$")]
    source: str
    """Source of the numbers."""
    roll: Loop
    pitch: Loop
    yaw: Loop
    attitude_dead_time_s: DeadTime = 0.0
    heave: Heave
    drag_1_s: tuple[NotNegative, NotNegative, NotNegative]
    """Deceleration per velocity through the air along each body axis."""
    fit_error: FitError | None = None


IDENTIFIED = np.dtype(
    [
        ("roll", "f8", 4),  # transition of (angle, rate) over a step, row by row
        ("pitch", "f8", 4),
        ("yaw", "f8", 4),
        ("roll_gain", "f8"),
        ("pitch_gain", "f8"),
        ("heave_gain", "f8"),
        ("heave", "f8"),  # fraction of a thrust error left after a step
        ("heave_half", "f8"),
        ("drag", "f8", 3),
        ("rate_limit", "f8"),
        ("yaw_rate_limit", "f8"),
        ("max_thrust", "f8"),
        ("attitude_delay", "i8"),  # steps
        ("heave_delay", "i8"),
    ],
    align=True,
)
"""Parameters of an identified model for kernels, for one time step."""


def identified_row(model: IdentifiedModel, airframe: Airframe, dt: float) -> NDArray[np.void]:
    """Returns the (1,) `IDENTIFIED` row of a model for steps of `dt` s, with the limits."""
    row = np.zeros(1, IDENTIFIED)
    for name in ("roll", "pitch", "yaw"):
        row[name] = transition(getattr(model, name), dt)
    row["roll_gain"], row["pitch_gain"] = model.roll.gain, model.pitch.gain
    row["heave_gain"] = model.heave.gain
    row["heave"] = math.exp(-dt / model.heave.time_constant_s)
    row["heave_half"] = math.exp(-0.5 * dt / model.heave.time_constant_s)
    row["drag"] = model.drag_1_s
    row["rate_limit"] = math.radians(airframe.limits.rate_deg_s)
    row["yaw_rate_limit"] = math.radians(airframe.limits.yaw_rate_deg_s)
    row["max_thrust"] = len(airframe.rotors.places) * airframe.max_rotor_thrust
    row["attitude_delay"] = round(model.attitude_dead_time_s / dt)
    row["heave_delay"] = round(model.heave.dead_time_s / dt)
    return row


def transition(loop: FirstOrder | SecondOrder, dt: float) -> Array:
    """Returns the transition of (angle to go, rate) in `dt` s: a (2, 2) matrix as (4,)."""
    if isinstance(loop, FirstOrder):
        left = math.exp(-dt / loop.time_constant_s)
        return np.array([left, 0.0, -left / loop.time_constant_s, 0.0])
    w, damping = loop.natural_frequency_rad_s, loop.damping
    half = -damping * w
    root = np.sqrt(complex(damping * damping - 1.0)) * w
    cosh = np.cosh(root * dt).real
    sinh = (np.sinh(root * dt) / root).real if abs(root) > 1e-9 else dt
    decay = math.exp(half * dt)
    return decay * np.array(
        [cosh - half * sinh, sinh, -w * w * sinh, cosh + half * sinh], dtype=np.float64
    )


def load_identified(name: str, folder: Path | None = None) -> IdentifiedModel:
    """Returns the model of a shipped name such as `f450`, or of a `.toml` file.

    Paths may be relative to `folder`. Raises `DataFileError`, naming the file, each wrong key and
    its allowed values, for an invalid file.
    """
    path = find_data_file(name, _MODELS, "identified model", folder)
    return load_data_file(path, IdentifiedModel, _MODELS)


@inner_kernel
def accelerate_identified(
    body: Any,
    plant: Any,
    model: Any,
    command: Any,
    live: bool,
    references: Array,
    i: int,
    now: int,
    dt: float,
) -> None:
    """Advances velocity and rates of a `BODY` to the end of the step.

    Counterpart of `rigid_body_kernels.accelerate`. command: a record with `attitude`, `thrust` and
    `yaw_rate`, and `rotor_reference`, which is set. live: whether its controllers run. references:
    (N, L, 6), commands of the last L steps in a ring; i: the UAV's row; now: the ring's row of this
    step.
    """
    for k in range(4):
        references[i, now, k] = command.attitude[k]
    references[i, now, 4] = command.thrust if live else 0.0
    references[i, now, 5] = command.yaw_rate

    half = 0.5 * dt
    row = _row_before(references, now, model.heave_delay)
    thrust = _thrust(body, plant, model, command, references[i, row, 4])
    if live:
        _turn(body, model, references, i, _row_before(references, now, model.attitude_delay), dt)
    else:
        for k in range(3):
            body.free_angular_acceleration[k] = body.angular_acceleration_body[k] = 0.0

    # forces at mid-step
    quarter = 0.5 * half
    ox, oy, oz = three(body.omega_body)
    gx, gy, gz = three(body.free_angular_acceleration)
    x, y, z, w = nudged(
        body.attitude[0],
        body.attitude[1],
        body.attitude[2],
        body.attitude[3],
        quarter * (ox - half * gx),
        quarter * (oy - half * gy),
        quarter * (oz - half * gz),
    )
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = matrix_of(x, y, z, w)
    vx, vy, vz = three(body.velocity_map)
    ax = vx + half * body.free_acceleration[0] - body.air_velocity_map[0]
    ay = vy + half * body.free_acceleration[1] - body.air_velocity_map[1]
    az = vz + half * body.free_acceleration[2] - body.air_velocity_map[2]
    fx = -model.drag[0] * (r00 * ax + r10 * ay + r20 * az)
    fy = -model.drag[1] * (r01 * ax + r11 * ay + r21 * az)
    fz = thrust * plant.inverse_mass - model.drag[2] * (r02 * ax + r12 * ay + r22 * az)
    ax = r00 * fx + r01 * fy + r02 * fz
    ay = r10 * fx + r11 * fy + r12 * fz
    az = r20 * fx + r21 * fy + r22 * fz - GRAVITY
    body.velocity_map[0] = vx + dt * ax
    body.velocity_map[1] = vy + dt * ay
    body.velocity_map[2] = vz + dt * az
    body.free_acceleration[0], body.free_acceleration[1], body.free_acceleration[2] = ax, ay, az
    for k in range(3):
        body.acceleration_map[k] = body.free_acceleration[k]
    body.on_ground = False


@inner_kernel
def _row_before(references: Array, now: int, delay: int) -> int:
    row = now - delay
    return row + references.shape[1] if row < 0 else row


@inner_kernel
def _thrust(body: Any, plant: Any, model: Any, command: Any, wanted: float) -> float:
    """Returns the thrust at mid-step, N; stores it as the equal speed of all rotors."""
    whole = plant.thrust_constant * plant.rotors
    wanted = min(max(model.heave_gain * wanted, 0.0), model.max_thrust)
    before = 0.0
    for r in range(plant.rotors):
        before += plant.thrust_constant * body.rotor_speed[r] * body.rotor_speed[r]
    after = wanted + (before - wanted) * model.heave
    speed, reference = math.sqrt(after / whole), math.sqrt(wanted / whole)
    for r in range(plant.rotors):
        body.rotor_speed[r] = speed
        command.rotor_reference[r] = reference
    mean: float = wanted + (before - wanted) * model.heave_half
    return mean


@inner_kernel
def _turn(body: Any, model: Any, references: Array, i: int, row: int, dt: float) -> None:
    """Computes rates at the step's end, and the acceleration with which `carry` turns exactly."""
    px, py, turn = _angles_to(
        body,
        model,
        references[i, row, 0],
        references[i, row, 1],
        references[i, row, 2],
        references[i, row, 3],
    )
    x, y, z, w = four(body.attitude)
    rate = references[i, row, 5]
    ux, uy = rate * 2.0 * (x * z - y * w), rate * 2.0 * (y * z + x * w)
    uz = rate * (1.0 - 2.0 * (x * x + y * y))
    limit = model.rate_limit
    _advance(body, 0, model.roll, px, ux, limit, dt)
    _advance(body, 1, model.pitch, py, uy, limit, dt)
    _advance(body, 2, model.yaw, turn, uz, model.yaw_rate_limit, dt)


@inner_kernel
def _advance(
    body: Any, axis: int, loop: Any, angle: float, moving: float, limit: float, dt: float
) -> None:
    """Advances one axis: `angle` rad to go to a reference that turns at `moving` rad/s."""
    before = body.omega_body[axis]
    lag = before - moving
    turn = (1.0 - loop[0]) * angle + loop[1] * lag + moving * dt
    rate = loop[3] * lag - loop[2] * angle + moving
    turn = min(max(turn, -limit * dt), limit * dt)
    rate = min(max(rate, -limit), limit)
    body.omega_body[axis] = rate
    back = 1.0 / dt
    # so that `carry`, which turns by the mean of both rates, turns by `turn`
    acceleration = 2.0 * back * (rate - back * turn)
    body.angular_acceleration_body[axis] = acceleration
    body.free_angular_acceleration[axis] = acceleration


@inner_kernel
def _angles_to(
    body: Any, model: Any, qx: float, qy: float, qz: float, qw: float
) -> tuple[float, float, float]:
    """Returns angles (rad) about the body's axes to the setpoint, its tilt times the loops' gains.

    Tilt and turn are separate, as in the attitude controller (`control.rates_attitude`).
    """
    # wanted = turn about z * tilt without z; the tilt times the gains
    n = math.sqrt(qz * qz + qw * qw)
    if n > 1e-6:
        k = 1.0 / n
        c, s = k * qw, k * qz
        tx = model.roll_gain * (c * qx + s * qy)
        ty = model.pitch_gain * (c * qy - s * qx)
        tw = math.sqrt(max(1.0 - tx * tx - ty * ty, 0.0))
        qx, qy, qz, qw = c * tx - s * ty, s * tx + c * ty, s * tw, c * tw
    x, y, z, w = four(body.attitude)
    ex = w * qx - x * qw - y * qz + z * qy
    ey = w * qy + x * qz - y * qw - z * qx
    ez = w * qz - x * qy + y * qx - z * qw
    ew = w * qw + x * qx + y * qy + z * qz
    n = math.sqrt(ez * ez + ew * ew)
    if n < 1e-6:
        return 2.0, 0.0, 0.0
    k = 2.0 / n
    turn = k * ez
    return k * (ew * ex - ez * ey), k * (ez * ex + ew * ey), -turn if ew < 0.0 else turn
