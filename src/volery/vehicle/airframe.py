"""Airframes: data files that describe vehicles, with the source of every number.

A file names masses, rotors (any number from 4 to 12, with any position and axis), feet and limits;
gains follow from these numbers unless the file overrides a bandwidth. `load_airframe` accepts the
name of a shipped vehicle or the path of a user's TOML file.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal, Self, TypeAlias

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from volery.core.arrays import Array
from volery.core.plurals import counted
from volery.scenario.data_files import find_data_file, load_data_file
from volery.vehicle.battery import Battery, open_circuit_voltage
from volery.vehicle.tables import NotNegative, Positive, PositiveVector, Table, Vector

GRAVITY = 9.80665
"""Standard gravity, m/s^2 (ISO 80000-3)."""
MAX_ROTORS = 12
"""Maximum number of rotors, a multiple of `core.simd`'s width: kernels compute two at a time."""
MAX_FEET = 8
_HOVER_MARGIN = 1.1
_AIRFRAMES = Path(__file__).parent / "airframes"


def _possible_inertia(moments: PositiveVector) -> PositiveVector:
    x, y, z = sorted(moments)
    if x + y < z * (1.0 - 1e-9):
        raise ValueError("no moment of inertia may exceed the sum of the other two")
    return moments


def _unit(axis: Vector) -> Vector:
    length = math.hypot(*axis)
    if length < 1e-6:
        raise ValueError("an axis must not be zero")
    return axis[0] / length, axis[1] / length, axis[2] / length


class Body(Table):
    """The rigid body; axes x forward, y left, z up, origin at the centre of mass."""

    mass_kg: Positive
    inertia_kg_m2: Annotated[PositiveVector, AfterValidator(_possible_inertia)]
    """Principal moments Ixx, Iyy, Izz; the body axes are the principal ones."""
    drag_area_m2: tuple[NotNegative, NotNegative, NotNegative]
    """Drag coefficient times area along each axis."""
    size_m: PositiveVector
    """Box of the plates, electronics and battery between the rotors."""
    collision_radius_m: Positive
    """Radius of a sphere about the origin that contains the whole vehicle, rotor discs included."""


class RotorGeometry(Table):
    """Position and sense of rotation of a rotor, seen from above."""

    position_m: Vector
    direction: Literal["ccw", "cw"]
    axis: Annotated[Vector, AfterValidator(_unit)] = (0.0, 0.0, 1.0)
    """Direction of its thrust; normalised."""


class Rotors(Table):
    """The rotors, all alike; the model is that of RotorS and PX4 (see `vehicle.aerodynamics`)."""

    thrust_n_s2: Positive
    torque_m: Positive
    drag_n_s2_m: NotNegative
    rolling_n_s2: NotNegative
    rise_time_s: Positive
    fall_time_s: Positive
    max_speed_rad_s: Positive
    radius_m: Positive
    places: Annotated[tuple[RotorGeometry, ...], Field(min_length=4, max_length=MAX_ROTORS)]


class Ground(Table):
    """Feet, friction and landing limits."""

    feet_m: Annotated[tuple[Vector, ...], Field(min_length=3, max_length=MAX_FEET)]
    landing_speed_limit_m_s: Positive
    friction: Annotated[float, Field(ge=0.0, le=2.0)]
    restitution: Annotated[float, Field(ge=0.0, le=1.0)]


Colour: TypeAlias = Literal["black", "grey", "white", "red", "orange", "amber", "blue", "green"]
"""Colours of a UAV's parts, for cameras and the page."""


class Colours(Table):
    """Colours of the parts, which cameras and the page show."""

    front: Colour = "orange"
    """Arms to the front, and the mark on the front of the body."""
    back: Colour = "grey"
    """The other arms."""
    plates: Colour = "black"
    legs: Colour = "black"


class Limits(Table):
    """Limits of the controllers' setpoints."""

    tilt_deg: Annotated[float, Field(gt=0.0, le=75.0)]
    speed_m_s: Positive
    climb_m_s: Positive
    descent_m_s: Positive
    take_off_m_s: Positive
    landing_m_s: Positive
    acceleration_m_s2: Positive
    rate_deg_s: Positive
    """Maximum roll and pitch rate."""
    yaw_rate_deg_s: Positive


class TrackingPoles(Table):
    """Poles of an axis group for `control.rpt`; omitted values are derived."""

    wn: Positive | None = None
    """Natural frequency times epsilon, rad/s."""
    zeta: Positive | None = None
    """Damping."""
    ki: NotNegative | None = None
    """Integral pole times epsilon, rad/s; 0: no integral."""
    epsilon: Positive = 1.0
    """Scale of the poles; smaller values track tighter."""


class Bandwidths(Table):
    """Bandwidths of the control loops, rad/s; omitted values follow from the rotors' lag."""

    rate: Positive | None = None
    yaw_rate: Positive | None = None
    attitude: Positive | None = None
    yaw: Positive | None = None
    velocity: Positive | None = None
    vertical: Positive | None = None
    position: Positive | None = None
    """Bandwidth of the reference's approach to a position."""
    horizontal: TrackingPoles = TrackingPoles()
    height: TrackingPoles = TrackingPoles()


class Airframe(Table):
    """A vehicle: body, rotors, feet, limits and, if given, battery and bandwidths."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9_]+$")]
    title: str
    body: Body
    rotors: Rotors
    ground: Ground
    limits: Limits
    colours: Colours = Colours()
    control: Bandwidths = Bandwidths()
    battery: Battery | None = None
    """Omitted: an ideal supply with constant voltage."""

    def __repr__(self) -> str:
        rotors = counted(len(self.rotors.places), "rotor")
        return f"<Airframe '{self.name}': {self.title}, {rotors}, {self.body.mass_kg:g} kg>"

    __str__ = __repr__

    @model_validator(mode="after")
    def _can_fly(self) -> Self:
        max_distance = _max_distance(self)
        if self.body.collision_radius_m < max_distance - 1e-6:
            raise ValueError(
                f"body.collision_radius_m = {self.body.collision_radius_m} excludes feet or "
                f"rotors; at least {max_distance:.3f} is needed"
            )
        if self.ground.landing_speed_limit_m_s <= self.limits.landing_m_s:
            raise ValueError(
                f"limits.landing_m_s = {self.limits.landing_m_s} must be below "
                f"ground.landing_speed_limit_m_s = {self.ground.landing_speed_limit_m_s}"
            )
        _check_feet(self)
        _check_hover(self)
        _check_battery(self)
        return self

    @property
    def weight(self) -> float:
        """Weight, N."""
        return self.body.mass_kg * GRAVITY

    @property
    def max_rotor_thrust(self) -> float:
        """Thrust of one rotor at full speed in still air, N."""
        return self.rotors.thrust_n_s2 * self.rotors.max_speed_rad_s**2

    @property
    def ground_offset(self) -> float:
        """Height of the origin above level ground on its feet, m."""
        return -min(foot[2] for foot in self.ground.feet_m)


def wrench_matrix(airframe: Airframe) -> Array:
    """Returns force and torque (6, R) on the body, FLU, per newton of each rotor's thrust."""
    columns = []
    for rotor in airframe.rotors.places:
        axis = np.array(rotor.axis)
        spin = 1.0 if rotor.direction == "ccw" else -1.0
        torque = np.cross(rotor.position_m, axis) - spin * airframe.rotors.torque_m * axis
        columns.append(np.concatenate([axis, torque]))
    return np.array(columns).T


def allocation_matrix(airframe: Airframe) -> Array:
    """Returns rotor thrusts (R, 4) per unit of thrust along z and torque about x, y, z.

    The pseudo-inverse of the rotors' geometry: among all thrusts with a given wrench, those with
    the smallest sum of squares.
    """
    return np.asarray(np.linalg.pinv(wrench_matrix(airframe)[2:]))


def hover_thrusts(airframe: Airframe) -> Array:
    """Returns the hover thrust of each rotor (R,), N, which carries the weight without torque."""
    return allocation_matrix(airframe)[:, 0] * airframe.weight


def _max_distance(airframe: Airframe) -> float:
    points = [math.hypot(*foot) for foot in airframe.ground.feet_m]
    for rotor in airframe.rotors.places:
        x, y, z = rotor.position_m
        points.append(math.hypot(math.hypot(x, y) + airframe.rotors.radius_m, z))
    return max(points)


def _check_feet(airframe: Airframe) -> None:
    feet = np.array(airframe.ground.feet_m)
    if feet[:, 2].max() >= 0.0:
        raise ValueError("ground.feet_m must lie below the centre of mass (z < 0)")
    bearings = np.sort(np.arctan2(feet[:, 1], feet[:, 0]))
    gaps = np.diff(np.append(bearings, bearings[0] + 2.0 * math.pi))
    if gaps.max() >= math.pi - 1e-6:
        raise ValueError(
            "ground.feet_m must surround the centre of mass, otherwise the vehicle falls over"
        )


def _check_hover(airframe: Airframe) -> None:
    matrix = wrench_matrix(airframe)[2:]
    scaled = matrix / np.abs(matrix).max(axis=1, keepdims=True).clip(1e-12)
    if np.linalg.matrix_rank(scaled, tol=1e-6) < 4:
        raise ValueError(
            "rotors.places cannot steer: thrust, roll, pitch and yaw must be independent"
        )
    lift = float(matrix[0].clip(0.0).sum()) * airframe.max_rotor_thrust
    if lift < _HOVER_MARGIN * airframe.weight:
        raise ValueError(
            f"rotors lift {lift:.3g} N at full speed; {_HOVER_MARGIN * airframe.weight:.3g} N, "
            "1.1 times the weight, are needed to hover"
        )
    trim = hover_thrusts(airframe)
    for number, thrust in enumerate(trim):
        if not 0.0 < thrust < airframe.max_rotor_thrust:
            raise ValueError(
                f"rotors.places.{number} needs {thrust:.3g} N in hover; more than 0 "
                f"and less than {airframe.max_rotor_thrust:.3g} N is possible"
            )


def hover_power(airframe: Airframe) -> float:
    """Returns the battery power in hover, W; 0 without a battery."""
    battery, rotors = airframe.battery, airframe.rotors
    if battery is None:
        return 0.0
    thrusts = hover_thrusts(airframe)
    torque = (battery.power_torque_m or rotors.torque_m) * thrusts
    shaft = float((torque * np.sqrt(thrusts / rotors.thrust_n_s2)).sum())
    return shaft / battery.efficiency + battery.avionics_w


def _check_battery(airframe: Airframe) -> None:
    battery = airframe.battery
    if battery is None:
        return
    source, power = open_circuit_voltage(battery, 1.0), hover_power(airframe)
    room = source**2 - 4.0 * battery.resistance_ohm * power
    voltage = 0.5 * (source + math.sqrt(max(room, 0.0)))
    speed = float(np.sqrt(hover_thrusts(airframe).max() / airframe.rotors.thrust_n_s2))
    needed = speed / airframe.rotors.max_speed_rad_s * battery.rated_v
    if room < 0.0 or voltage < needed:
        raise ValueError(
            f"battery cannot sustain hover, which takes {power:.3g} W at no less than "
            f"{needed:.3g} V; a full pack of {source:.3g} V behind {battery.resistance_ohm} ohm "
            f"{'cannot give that power' if room < 0.0 else f'sags to {voltage:.3g} V'}"
        )


def airframe_names() -> tuple[str, ...]:
    """Returns the names of the shipped airframes."""
    return tuple(sorted(path.stem for path in _AIRFRAMES.glob("*.toml")))


def load_airframe(name: str | Path, folder: Path | None = None) -> Airframe:
    """Returns the airframe of a shipped name such as `f450`, or of a `.toml` file.

    Paths may be relative to `folder`. Raises `DataFileError`, naming the file, each wrong key and
    its allowed values, for an invalid file.
    """
    path = find_data_file(str(name), _AIRFRAMES, "airframe", folder)
    return load_data_file(path, Airframe, _AIRFRAMES)
