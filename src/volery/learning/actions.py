"""Actions of policies: numbers from -1 to 1, or choices, that become commands of one level."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from volery.core import rotations
from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.vehicle.airframe import hover_thrusts

_AXES = np.array(
    [[0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], np.float64
)


class Action(Protocol):
    """Turns actions into commands."""

    @property
    def size(self) -> int:
        """Numbers in the action of one UAV."""

    @property
    def choices(self) -> int | None:
        """Number of choices of a discrete action, None for continuous actions."""

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; action: (K, n, size), continuous ones from -1 to 1."""


@dataclass(frozen=True)
class Velocity:
    """Velocity in the level heading frame and yaw rate."""

    speed_m_s: float = 3.0
    yaw_rate_rad_s: float = 1.0
    size: ClassVar[int] = 4
    choices: ClassVar[int | None] = None

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        velocity, yaw_rate = self.speed_m_s * action[..., :3], self.yaw_rate_rad_s * action[..., 3]
        flight.envs.command_velocity(velocity, yaw_rate)


@dataclass(frozen=True)
class DiscreteVelocity:
    """Seven choices: hover, or fly forward, back, left, right, up or down in the heading frame."""

    speed_m_s: float = 1.0
    size: ClassVar[int] = 1
    choices: ClassVar[int | None] = len(_AXES)

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        flight.envs.command_velocity(self.speed_m_s * _AXES[action[..., 0].astype(np.int64)])


@dataclass(frozen=True)
class AttitudeThrust:
    """Roll and pitch, yaw rate and thrust: 0 is the thrust of hover, -1 none, 1 twice that."""

    tilt_rad: float = math.radians(40.0)
    yaw_rate_rad_s: float = 1.0
    size: ClassVar[int] = 4
    choices: ClassVar[int | None] = None

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        roll, pitch = self.tilt_rad * action[..., 0], self.tilt_rad * action[..., 1]
        ahead_s = 1.0 / flight.decision_rate_hz
        turn = ahead_s * self.yaw_rate_rad_s * action[..., 2]
        yaw = rotations.yaw_of(flight.state.attitude) + turn
        flight.envs.command_attitude(rotations.from_rpy(roll, pitch, yaw), _thrust(flight, action))


@dataclass(frozen=True)
class RatesThrust:
    """Body rates and thrust: 0 is the thrust of hover, -1 none, 1 twice that."""

    rate_rad_s: float = 2.0 * math.pi
    size: ClassVar[int] = 4
    choices: ClassVar[int | None] = None

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        flight.envs.command_rates(self.rate_rad_s * action[..., :3], _thrust(flight, action))


@dataclass(frozen=True)
class RotorSpeeds:
    """Speeds of the rotors: 0 is the speed of hover, 1 the maximum, -1 standstill."""

    rotors: int = 4
    choices: ClassVar[int | None] = None

    @property
    def size(self) -> int:
        """Numbers in the action of one UAV."""
        return self.rotors

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        rotors = flight.airframe.rotors
        hover = np.sqrt(hover_thrusts(flight.airframe) / rotors.thrust_n_s2)
        up, down = np.maximum(action, 0.0), np.minimum(action, 0.0)
        speeds = hover + (rotors.max_speed_rad_s - hover) * up + hover * down
        flight.envs.command_rotor_speeds(speeds)


def _thrust(flight: Flight, action: Array) -> Array:
    """Returns thrusts (K, n), N, of the last number of each action."""
    airframe = flight.airframe
    most = airframe.max_rotor_thrust * len(airframe.rotors.places)
    return np.asarray(np.minimum(airframe.weight * (1.0 + action[..., 3]), most))
