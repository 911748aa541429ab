"""Identification: fits the identified plant to flights of the rigid body.

The rigid body flies steps, doublets and chirps of one input at a time; the loops' parameters
minimise the squared difference. Other flights, in which all inputs move at once, measure the error
(`validate`). Needs scipy: the extra `volery[identify]`.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from volery.control.identification_flights import (
    SAMPLE_S,
    chirps_of_attitude,
    chirps_of_thrust,
    cruises,
    everything_at_once,
    velocity_errors,
)
from volery.core.arrays import Array
from volery.core.extras import import_extra
from volery.vehicle.airframe import GRAVITY, Airframe
from volery.vehicle.identified import (
    FirstOrder,
    FitError,
    Heave,
    IdentifiedModel,
    SecondOrder,
    transition,
)
from volery.vehicle.plant_types import RigidBody

_MAX_DEAD_TIME_S = 0.1


def identify(airframe: Airframe, order: Literal[1, 2] = 2) -> IdentifiedModel:
    """Identifies the closed loops of an airframe; roll and pitch of first or second order.

    Raises `VoleryError` if scipy is not installed.
    """
    optimize = _scipy("optimize")
    flights = [chirps_of_attitude(airframe, axis) for axis in range(3)]
    tilts = flights[:2]

    def tilt_errors(x: Array) -> Array:
        loops = (_loop(order, x[1:4]), _loop(order, x[4:7]))
        parts = [
            _answer(loop, x[0], flight.wanted[:, axis]) - flight.angles[:, axis]
            for axis, (loop, flight) in enumerate(zip(loops, tilts, strict=True))
        ]
        return np.concatenate(parts)

    start = _start(order)
    x = optimize.least_squares(
        tilt_errors,
        [0.02, *start, *start],
        bounds=([0.0, *[1e-2] * 6], [_MAX_DEAD_TIME_S, *[100.0, 5.0, 2.0] * 2]),
        x_scale=[0.01, *np.abs(start), *np.abs(start)],
    ).x
    dead_time = float(x[0])
    yaw = optimize.least_squares(
        lambda y: (
            _answer(_loop(2, [*y, 1.0]), dead_time, flights[2].wanted[:, 2])
            - flights[2].angles[:, 2]
        ),
        [5.0, 1.0],
        bounds=([0.1, 0.1], [100.0, 5.0]),
    ).x
    heave, rising_drag = _fit_heave(optimize, airframe)
    drag = _fit_drag(airframe)
    model = IdentifiedModel(
        name=airframe.name,
        source=(
            f"identified from this project's own rigid body of the airframe '{airframe.name}' "
            f"({airframe.title}) by `volery identify`"
        ),
        roll=_rounded(_loop(order, x[1:4])),
        pitch=_rounded(_loop(order, x[4:7])),
        yaw=_rounded(_loop(2, [*yaw, 1.0])),
        attitude_dead_time_s=round(dead_time, 4),
        heave=heave,
        drag_1_s=(round(drag[0], 4), round(drag[1], 4), round(rising_drag, 4)),
    )
    return model.model_copy(update={"fit_error": validate(model, airframe)})


def validate(model: IdentifiedModel, airframe: Airframe) -> FitError:
    """Returns root mean square differences from the rigid body on flights not used for the fit."""
    truth = everything_at_once(airframe, RigidBody())
    shown = everything_at_once(airframe, model)
    tilt = np.hypot(*(shown.angles - truth.angles)[:, :2].T)
    return FitError(
        attitude_deg=_rms(np.degrees(tilt)),
        yaw_deg=_rms(np.degrees(shown.angles[:, 2] - truth.angles[:, 2])),
        vertical_acceleration_m_s2=_rms(shown.acceleration[:, 2] - truth.acceleration[:, 2]),
        velocity_m_s=_rms(velocity_errors(airframe, model)),
    )


def to_toml(model: IdentifiedModel) -> str:
    """Returns the model as the text of a data file."""
    order = " --order 1" if model.roll.kind == "first_order" else ""
    lines = [
        f"# Closed loops of the airframe '{model.name}' from wanted to true attitude and thrust.",
        f"# Made by: volery identify {model.name}{order} --out {model.name}.toml",
        "# Not measured on a real vehicle: identified from this project's rigid body.",
        "",
    ]
    tables = []
    for key, value in model.model_dump(exclude_none=True).items():
        if isinstance(value, dict):
            tables += ["", f"[{key}]"] + [f"{k} = {_shown(v)}" for k, v in value.items()]
        else:
            lines.append(f"{key} = {_shown(value)}")
    note = tables.index("[fit_error]") if "[fit_error]" in tables else len(tables)
    tables.insert(note, "# root mean square, on flights that were not used for the fit")
    return "\n".join(lines + tables) + "\n"


def _fit_heave(optimize: Any, airframe: Airframe) -> tuple[Heave, float]:
    """Fits lag, gain and dead time of the thrust, and the drag (1/s) along the body's z."""
    flight = chirps_of_thrust(airframe)
    per_mass = flight.thrust / airframe.body.mass_kg

    def errors(x: Array) -> Array:
        loop = FirstOrder(kind="first_order", time_constant_s=x[0], gain=x[1])
        force = _answer(loop, x[2], per_mass - GRAVITY) + x[1] * GRAVITY - GRAVITY
        return np.asarray(force - x[3] * flight.velocity[:, 2] - flight.acceleration[:, 2])

    tau, gain, dead_time, drag = optimize.least_squares(
        errors, [0.02, 1.0, 0.002, 0.1], bounds=([1e-3, 0.5, 0.0, 0.0], [0.5, 1.5, 0.1, 5.0])
    ).x
    heave = Heave(
        time_constant_s=round(tau, 4), gain=round(gain, 4), dead_time_s=round(dead_time, 4)
    )
    return heave, float(drag)


def _fit_drag(airframe: Airframe) -> Array:
    """Fits the drag (2,) 1/s along body x and y to specific forces and velocities in cruise."""
    force, velocity = cruises(airframe)
    return np.asarray(-(force * velocity).sum(axis=0) / (velocity**2).sum(axis=0))[:2]


def _answer(loop: FirstOrder | SecondOrder, dead_time: float, wanted: Array) -> Array:
    """Returns the response of a loop, at rest at first, to an input (K,) held between samples."""
    lfilter = _scipy("signal").lfilter

    whole = int(dead_time / SAMPLE_S)
    part = dead_time / SAMPLE_S - whole
    late = np.concatenate([np.zeros(whole + 1), wanted])[: len(wanted) + 1]
    # late[k] is the input one sample before that of the whole delay
    delayed = (1.0 - part) * late[1:] + part * late[:-1]
    a, b, c, d = transition(loop, SAMPLE_S)
    # (angle to go, rate) move on by [[a, b], [c, d]]; as a filter from input to angle
    poles = [1.0, -(a + d), a * d - b * c]
    zeros = [0.0, 1.0 - a, (a * d - b * c) - d]
    return np.asarray(loop.gain * lfilter(zeros, poles, delayed))


def _loop(order: int, x: Any) -> FirstOrder | SecondOrder:
    if order == 1:
        return FirstOrder(kind="first_order", time_constant_s=float(x[0]), gain=float(x[2]))
    return SecondOrder(
        kind="second_order",
        natural_frequency_rad_s=float(x[0]),
        damping=float(x[1]),
        gain=float(x[2]),
    )


def _start(order: int) -> list[float]:
    return [0.2, 1.0, 1.0] if order == 1 else [10.0, 0.8, 1.0]


def _rounded(loop: FirstOrder | SecondOrder) -> FirstOrder | SecondOrder:
    numbers = {k: round(v, 4) for k, v in loop.model_dump().items() if k != "kind"}
    return loop.model_copy(update=numbers)


def _rms(x: Array) -> float:
    return round(float(np.sqrt(np.mean(np.square(x)))), 4)


def _shown(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_shown(v) for v in value) + "]"
    return repr(value)


def _scipy(part: str) -> Any:
    """Returns a module of scipy; raises `VoleryError` if it cannot be imported."""
    return import_extra("identification", f"scipy.{part}", "scipy", "identify")
