"""Gains of the control layers, derived from an airframe.

The rotors' lag bounds everything: the rate loop gets 0.4 / lag (a damping near 0.8), and each layer
above about a third of the bandwidth of the layer below. An airframe file may override each
bandwidth. Torques are angular accelerations times inertia, so gains do not contain the inertia.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.control.rpt import height_gains, level_gains
from volery.vehicle.airframe import (
    GRAVITY,
    MAX_ROTORS,
    Airframe,
    allocation_matrix,
    hover_thrusts,
)
from volery.vehicle.drag import drag_acceleration, hover_rotor_drags

_AIR_PERIOD_S = 0.008
"""Minimum time between updates of the air; eddies and jets that affect a vehicle last longer."""
_THRUST_RESERVE = 0.9
"""Fraction of the full thrust that guidance may use; the rest is for attitude control."""
_MIN_THRUST = 0.15
"""Minimum thrust of guidance as a fraction of the weight, which preserves attitude control."""
_MIN_INTEGRAL, _MAX_INTEGRAL = 0.5, 0.8
"""Bounds of the integrals, in g. Flying 2 m below a similar UAV an F450 needs 0.4 g; a vehicle with
much drag needs more in wind."""
_IDLE_SPEED = 0.1
"""Idle speed of a rotor, as a fraction of its hover speed."""

GAINS = np.dtype(
    [
        ("rotors", "i8"),
        ("mass", "f8"),
        ("weight", "f8"),
        ("gyroscopic", "f8", 3),  # (Izz - Iyy) / Ixx and so on around
        ("by_thrust", "f8", MAX_ROTORS),  # each rotor's thrust for one newton of the whole ...
        ("by_roll", "f8", MAX_ROTORS),  # ... and for 1 rad/s^2 about x, y, z
        ("by_pitch", "f8", MAX_ROTORS),
        ("by_yaw", "f8", MAX_ROTORS),
        ("idle_thrust", "f8"),
        ("min_thrusts", "f8", MAX_ROTORS),  # idle_thrust; below zero where there is no rotor
        ("inverse_thrust_constant", "f8"),
        ("rate", "f8", 3),
        ("rate_drag", "f8", 3),
        ("rate_integral", "f8", 3),
        ("rate_integral_limit", "f8", 3),
        ("attitude", "f8"),
        ("yaw", "f8"),
        ("rate_limit", "f8"),
        ("yaw_rate_limit", "f8"),
        ("velocity", "f8"),
        ("velocity_integral", "f8"),
        ("vertical", "f8"),
        ("vertical_integral", "f8"),
        ("integral_limit", "f8"),
        ("drag", "f8"),
        ("position", "f8"),
        ("level_position", "f8"),
        ("level_velocity", "f8"),
        ("level_integral", "f8"),
        ("height_position", "f8"),
        ("height_velocity", "f8"),
        ("height_integral", "f8"),
        ("level_leash", "f8"),
        ("height_leash", "f8"),
        ("ease", "f8"),
        ("lead", "f8"),
        ("brake", "f8"),
        ("level_linear", "f8"),
        ("height_brake", "f8"),
        ("height_linear", "f8"),
        ("acceleration", "f8"),
        ("climb_acceleration", "f8"),
        ("tilt_tangent", "f8"),
        ("min_thrust", "f8"),
        ("max_thrust", "f8"),
        ("speed", "f8"),
        ("climb", "f8"),
        ("descent", "f8"),
        ("take_off", "f8"),
        ("landing", "f8"),
        ("min_acceleration", "f8"),
        ("max_acceleration", "f8"),
        ("tick", "f8"),
        ("inverse_tick", "f8"),
    ],
    align=True,
)
"""Control parameters of one airframe, for kernels: SI, FLU."""


@dataclass(frozen=True)
class ControlRates:
    """Rates of the layers, Hz, in whole physics steps; rates are controlled at every step."""

    guidance_hz: float = 125.0
    """Rate of flight modes, trajectories and the outer loop."""
    attitude_hz: float = 250.0

    def guidance_steps(self, dt: float) -> int:
        """Returns the physics steps of `dt` s between guidance ticks."""
        return max(1, round(1.0 / (self.guidance_hz * dt)))

    def air_steps(self, dt: float) -> int:
        """Returns the physics steps between updates of the air: guidance ticks, about 8 ms."""
        steps = self.guidance_steps(dt)
        return steps * max(1, round(_AIR_PERIOD_S / (steps * dt)))

    def attitude_steps(self, dt: float) -> int:
        """Returns the physics steps of `dt` s between attitude ticks."""
        return max(1, round(1.0 / (self.attitude_hz * dt)))


STANDARD_RATES = ControlRates()


def gains_of(  # noqa: PLR0915
    airframe: Airframe, dt: float, control: ControlRates = STANDARD_RATES
) -> NDArray[np.void]:
    """Returns the (1,) `GAINS` row of an airframe stepped by `dt` s."""
    row = np.zeros(1, GAINS)
    rotors, limits, wish = airframe.rotors, airframe.limits, airframe.control
    count = len(rotors.places)
    inertia = np.array(airframe.body.inertia_kg_m2)
    allocation = allocation_matrix(airframe)
    trim = hover_thrusts(airframe)
    max_thrust = airframe.max_rotor_thrust * airframe.weight / float(trim.max())

    rate = wish.rate or 0.4 / (0.5 * (rotors.rise_time_s + rotors.fall_time_s))
    yaw_rate = wish.yaw_rate or 0.5 * rate
    attitude = wish.attitude or rate / 3.0
    yaw = wish.yaw or yaw_rate / 4.0
    velocity = wish.velocity or attitude / 3.0
    vertical = wish.vertical or rate / 5.0
    position = wish.position or velocity / 2.4

    row["rotors"] = count
    row["mass"] = airframe.body.mass_kg
    row["weight"] = airframe.weight
    row["gyroscopic"] = (np.roll(inertia, 1) - np.roll(inertia, -1)) / inertia
    for k, name in enumerate(("by_thrust", "by_roll", "by_pitch", "by_yaw")):
        row[name][0, :count] = allocation[:, k] * (1.0, *inertia)[k]
    row["idle_thrust"] = _IDLE_SPEED**2 * trim.min()
    row["min_thrusts"] = np.where(np.arange(MAX_ROTORS) < count, row["idle_thrust"], -1.0)
    row["inverse_thrust_constant"] = 1.0 / rotors.thrust_n_s2
    bandwidths = np.array([rate, rate, yaw_rate])
    row["rate"] = bandwidths
    row["rate_integral"] = np.array([0.1, 0.1, 0.03]) * bandwidths**2
    row["rate_integral_limit"] = 0.8 * _authority(airframe) / inertia
    row["attitude"] = attitude
    row["yaw"] = yaw
    row["rate_limit"] = math.radians(limits.rate_deg_s)
    row["yaw_rate_limit"] = math.radians(limits.yaw_rate_deg_s)
    row["velocity"] = velocity
    row["velocity_integral"] = 0.25 * velocity**2
    row["vertical"] = vertical
    row["vertical_integral"] = 0.25 * vertical**2
    # in-plane drag of the rotors in hover, 1/s: known from the airframe, so fed forward
    drags = hover_rotor_drags(airframe)
    row["drag"] = drags.sum() / airframe.body.mass_kg
    row["rate_drag"] = _rate_drag(airframe, drags) / inertia
    # compensates for a steady wind as fast as the vehicle flies
    wind = drag_acceleration(airframe, limits.speed_m_s)
    row["integral_limit"] = min(max(_MIN_INTEGRAL * GRAVITY, wind), _MAX_INTEGRAL * GRAVITY)
    row["position"] = position
    level, height = level_gains(wish.horizontal, attitude), height_gains(wish.height, rate)
    for name, gain in level._asdict().items():
        row[f"level_{name}"] = gain
    for name, gain in height._asdict().items():
        row[f"height_{name}"] = gain
    row["ease"] = max(0.5 * attitude, 2.0 * position)
    row["brake"] = 0.6 * limits.acceleration_m_s2
    row["acceleration"] = limits.acceleration_m_s2
    row["climb_acceleration"] = min(
        limits.acceleration_m_s2,
        0.6 * (_THRUST_RESERVE * max_thrust / airframe.body.mass_kg - GRAVITY),
    )
    row["level_linear"] = row["brake"] / position**2
    row["height_brake"] = 0.6 * row["climb_acceleration"]
    row["height_linear"] = row["height_brake"] / position**2
    row["level_leash"] = row["acceleration"] / level.position
    row["height_leash"] = row["climb_acceleration"] / height.position
    row["tilt_tangent"] = math.tan(math.radians(limits.tilt_deg))
    row["min_thrust"] = _MIN_THRUST * airframe.weight
    row["max_thrust"] = _THRUST_RESERVE * max_thrust
    row["speed"] = limits.speed_m_s
    row["climb"] = limits.climb_m_s
    row["descent"] = limits.descent_m_s
    row["take_off"] = limits.take_off_m_s
    row["landing"] = limits.landing_m_s
    row["tick"] = control.guidance_steps(dt) * dt
    row["inverse_tick"] = 1.0 / row["tick"]
    row["lead"] = 1.0 / attitude + row["tick"]
    row["min_acceleration"] = row["min_thrust"] / airframe.body.mass_kg
    row["max_acceleration"] = row["max_thrust"] / airframe.body.mass_kg
    return row


def _rate_drag(airframe: Airframe, drags: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns the torque (3,) about each body axis per rad/s, from the rotors' in-plane drag."""
    torque = np.zeros(3)
    for rotor, drag in zip(airframe.rotors.places, drags, strict=True):
        arm, axis = np.array(rotor.position_m), np.array(rotor.axis)
        moved = np.cross(np.eye(3), arm)  # row k: velocity of the hub for 1 rad/s about axis k
        across = moved - np.outer(moved @ axis, axis)
        torque += drag * np.cross(arm, across).diagonal()
    return torque


def _authority(airframe: Airframe) -> NDArray[np.float64]:
    """Returns the torque (3,) about each axis available to the rotors in hover, N m."""
    trim, allocation = hover_thrusts(airframe), np.abs(allocation_matrix(airframe)[:, 1:])
    room = np.minimum(trim, airframe.max_rotor_thrust - trim)
    return np.asarray((room[:, None] / np.maximum(allocation, 1e-12)).min(axis=0))
