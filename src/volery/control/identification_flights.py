"""The flights used for identification and for validation."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.core.arrays import Array
from volery.vehicle.airframe import GRAVITY, Airframe
from volery.vehicle.plant_types import Plant, RigidBody
from volery.world.terrain import Terrain

SAMPLE_S = 0.002
"""Time between two samples, s; two physics steps."""
_COMMAND_SAMPLES = 4
"""Samples between two commands: those of a guidance tick."""
_AIR = Terrain.flat(1e5, -1e4, (-5e4, -5e4)).grid
_TILT, _TURN = math.radians(6.0), math.radians(8.0)
"""Amplitudes of the inputs: small enough to stay within all limits."""

_CLIMB_FEEDBACK = 0.15
"""Fraction of the weight per m/s of climb that is subtracted from the thrust: rotors lose thrust
with the speed along their axis, up or down, so that a constant thrust would end in a fall."""

Inputs = Callable[[float], tuple[float, float, float, float]]
"""Returns roll, pitch, yaw (rad) and thrust (fraction of the weight) at a time (s)."""


class IdentificationFlight(NamedTuple):
    """Setpoints and motion, K samples."""

    wanted: Array
    """(K, 3) setpoints of roll, pitch, yaw, rad: held between samples."""
    thrust: Array
    """(K,) setpoints of the thrust, N."""
    angles: Array
    """(K, 3) roll, pitch, yaw, rad, at the samples."""
    velocity: Array
    """(K, 3) m/s, map."""
    acceleration: Array
    """(K, 3) m/s^2, map: the mean over the last physics step."""


def chirps_of_attitude(airframe: Airframe, axis: int) -> IdentificationFlight:
    """Flies doublets, then a chirp, about one axis: 0 roll, 1 pitch, 2 yaw."""
    amplitude, fastest = (_TURN, 1.5) if axis == 2 else (_TILT, 3.0)

    def inputs(t: float) -> tuple[float, float, float, float]:
        angles = [0.0, 0.0, 0.0]
        angles[axis] = amplitude * _test_signal(t, fastest)
        return angles[0], angles[1], angles[2], 1.0 / math.cos(math.hypot(*angles[:2]))

    return _fly(airframe, RigidBody(), inputs, 16.0)


def chirps_of_thrust(airframe: Airframe) -> IdentificationFlight:
    """Flies doublets and a chirp of the thrust, a tenth of the weight up and down."""
    return _fly(
        airframe, RigidBody(), lambda t: (0.0, 0.0, 0.0, 1.0 + 0.1 * _test_signal(t, 4.0)), 16.0
    )


def everything_at_once(airframe: Airframe, plant: Plant) -> IdentificationFlight:
    """Flies sums of sines about all axes and along the thrust, with steps added."""

    def inputs(t: float) -> tuple[float, float, float, float]:
        roll = 0.10 * math.sin(2.3 * t) + 0.06 * math.sin(7.1 * t) + (0.08 if t % 3 > 2 else 0.0)
        pitch = 0.09 * math.sin(1.7 * t) - 0.07 * math.sin(5.3 * t) - (0.1 if t % 4 > 3 else 0.0)
        yaw = 0.25 * math.sin(0.9 * t) + (0.15 if t % 5 > 4 else 0.0)
        thrust = 1.0 + 0.06 * math.sin(3.1 * t) + (0.05 if t % 2 > 1 else -0.05)
        return roll, pitch, yaw, thrust

    return _fly(airframe, plant, inputs, 8.0)


def cruises(airframe: Airframe) -> tuple[Array, Array]:
    """Returns specific force and velocity in cruise, (K, 3) each, body axes, several speeds."""
    top = 0.6 * airframe.limits.speed_m_s
    directions = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.7, 0.7)]
    speeds = (0.25 * top, 0.5 * top, top)
    fleet = _fleet(airframe, RigidBody(), len(directions) * len(speeds))
    fleet.set_command_timeout(60.0)
    for i in range(len(fleet)):
        direction = np.array([*directions[i % len(directions)], 0.0])
        fleet.command_velocity_map(i, speeds[i // len(directions)] * direction)
    forces, velocities = [], []
    for _ in range(100):
        fleet.advance(60, _AIR)
        back = np.swapaxes(rotations.matrix(fleet.state.attitude), 1, 2)
        felt = fleet.state.acceleration_map + np.array([0.0, 0.0, GRAVITY])
        forces.append(np.einsum("nij,nj->ni", back, felt))
        velocities.append(np.einsum("nij,nj->ni", back, fleet.state.velocity_map))
    return np.concatenate(forces), np.concatenate(velocities)


def velocity_errors(airframe: Airframe, plant: Plant) -> Array:
    """Returns velocity differences (K,) m/s of the rigid body and `plant` in guided flight."""
    pair = [_fleet(airframe, each) for each in (RigidBody(), plant)]
    errors = []
    for velocity in ((2, 0, 0), (0, 3, 1), (-2, -2, -0.5), (0, 0, 0)):
        for fleet in pair:
            fleet.set_command_timeout(60.0)
            fleet.command_velocity_map(0, velocity)
        for _ in range(150):
            for fleet in pair:
                fleet.advance(20, _AIR)
            apart = pair[0].state.velocity_map[0] - pair[1].state.velocity_map[0]
            errors.append(np.linalg.norm(apart))
    return np.array(errors)


def _test_signal(t: float, fastest_hz: float) -> float:
    """Returns doublets of 1 s and of 0.5 s, then a chirp from 0.2 Hz up, within +-1."""
    if t < 0.5:
        return 0.0
    if t < 2.5:
        return 1.0 if t < 1.5 else -1.0
    if t < 3.5:
        return 0.0
    if t < 4.5:
        return 0.7 if t < 4.0 else -0.7
    if t < 5.0:
        return 0.0
    s = t - 5.0
    return math.sin(2.0 * math.pi * s * (0.2 + 0.5 * (fastest_hz - 0.2) * s / 11.0))


def _fly(airframe: Airframe, plant: Plant, inputs: Inputs, seconds: float) -> IdentificationFlight:
    fleet = _fleet(airframe, plant)
    state = fleet.state
    steps = round(SAMPLE_S * 1e9 / fleet.dt_ns)
    rows = []
    for k in range(round(seconds / SAMPLE_S)):
        if k % _COMMAND_SAMPLES == 0:
            roll, pitch, yaw, fraction = inputs(k * SAMPLE_S)
            fraction -= _CLIMB_FEEDBACK * float(state.velocity_map[0, 2])
            thrust = fraction * airframe.weight
            fleet.command_attitude(0, rotations.from_rpy(roll, pitch, yaw), thrust)
        angles = rotations.to_rpy(state.attitude[0])
        rows.append(
            [
                *(roll, pitch, yaw, thrust),
                *angles,
                *state.velocity_map[0],
                *state.acceleration_map[0],
            ]
        )
        fleet.advance(steps, _AIR)
    flown = np.array(rows)
    return IdentificationFlight(
        flown[:, :3], flown[:, 3], flown[:, 4:7], flown[:, 7:10], flown[:, 10:]
    )


def _fleet(airframe: Airframe, plant: Plant, count: int = 1) -> Fleet:
    positions = np.column_stack([10.0 * np.arange(count), np.zeros(count), np.zeros(count)])
    level = np.tile(rotations.IDENTITY, (count, 1))
    return Fleet([airframe] * count, positions, level, plants=plant)
