"""Actions of policies: numbers from -1 to 1, or choices, that become commands of one level."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import ClassVar, Protocol

import numpy as np

from volery.autonomy.policy import action_terms
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.errors import ScenarioError
from volery.learning.flight import Flight
from volery.vehicle.airframe import hover_thrusts


class Action(Protocol):
    """Turns actions into commands; the fields of the dataclass are the parameters of its kind."""

    kind: ClassVar[str]
    """Name of the kind in policy files."""

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
    """Velocity in the level heading frame and yaw rate.

    The four numbers of -1 to 1 are forward, left and up, where 1 is `speed_m_s`, and the yaw rate,
    counter-clockwise from above, where 1 is `yaw_rate_rad_s`.
    """

    speed_m_s: float = 3.0
    yaw_rate_rad_s: float = 1.0
    kind: ClassVar[str] = "velocity"
    size: ClassVar[int] = 4
    choices: ClassVar[int | None] = None

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        velocity, yaw_rate = action_terms.velocity(action, self.speed_m_s, self.yaw_rate_rad_s)
        flight.envs.command_velocity(velocity, yaw_rate)


@dataclass(frozen=True)
class LevelVelocity:
    """Forward and lateral velocity in the level heading frame, at a height that is kept.

    The first number is 0 to `forward_m_s`, from -1 to 1, the second `lateral_m_s` to the left at 1.
    The heading does not change.
    """

    forward_m_s: float = 5.0
    lateral_m_s: float = 3.0
    keep_height_m: float = 2.0
    climb_m_s: float = 1.0
    kind: ClassVar[str] = "level_velocity"
    size: ClassVar[int] = 2
    choices: ClassVar[int | None] = None

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        height = flight.state.position_map[..., 2]
        flight.envs.command_velocity(
            action_terms.level_velocity(action, height, **dataclasses.asdict(self))
        )


@dataclass(frozen=True)
class LimitedVelocity:
    """Velocity in the level heading frame, of any direction and limited length; yaw is held."""

    speed_m_s: float = 3.0
    kind: ClassVar[str] = "limited_velocity"
    size: ClassVar[int] = 3
    choices: ClassVar[int | None] = None

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        flight.envs.command_velocity(action_terms.limited_velocity(action, self.speed_m_s))


@dataclass(frozen=True)
class DiscreteVelocity:
    """Seven choices: hover, or fly forward, back, left, right, up or down in the heading frame."""

    speed_m_s: float = 1.0
    kind: ClassVar[str] = "discrete_velocity"
    size: ClassVar[int] = 1
    choices: ClassVar[int | None] = action_terms.DISCRETE_VELOCITIES

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        choice = action[..., 0].astype(np.int64)
        flight.envs.command_velocity(action_terms.discrete_velocity(choice, self.speed_m_s))


@dataclass(frozen=True)
class Position:
    """Position relative to the present one, in the level heading frame, and yaw rate.

    The UAV flies to it and stops there, unless a later action moves it.
    """

    range_m: float = 1.0
    yaw_rate_rad_s: float = 1.0
    kind: ClassVar[str] = "position"
    size: ClassVar[int] = 4
    choices: ClassVar[int | None] = None

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        yaw = rotations.yaw_of(flight.state.attitude)
        goal = action_terms.position(action, flight.state.position_map, yaw, self.range_m)
        flight.envs.command_setpoint(goal, yaw_rate=self.yaw_rate_rad_s * action[..., 3])


@dataclass(frozen=True)
class Choices:
    """Choices among rows of a table of another, continuous action."""

    action: Action
    table: tuple[tuple[float, ...], ...]
    """(choices, size of the action), numbers from -1 to 1; the first one is taken at the start."""
    of: str = field(init=False)
    """Kind of the action."""
    kind: ClassVar[str] = "choices"
    size: ClassVar[int] = 1

    def __post_init__(self) -> None:
        """Raises `ScenarioError` if the table does not fit the action."""
        table = np.array(self.table, np.float64)
        fits = table.ndim == 2 and table.shape[1] == self.action.size and len(table) > 1
        if self.action.choices is not None or not fits or not (np.abs(table) <= 1.0).all():
            raise ScenarioError(
                f"choices of '{self.action.kind}': at least two rows of {self.action.size} numbers "
                "from -1 to 1 of a continuous action are needed"
            )
        object.__setattr__(self, "of", self.action.kind)

    @property
    def choices(self) -> int | None:
        """Number of choices."""
        return len(self.table)

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        rows = np.array(self.table, np.float64)[action[..., 0].astype(np.int64)]
        self.action.command(flight, rows)


@dataclass(frozen=True)
class AttitudeThrust:
    """Roll and pitch, yaw rate and thrust: 0 is the thrust of hover, -1 none, 1 twice that."""

    tilt_rad: float = math.radians(40.0)
    yaw_rate_rad_s: float = 1.0
    kind: ClassVar[str] = "attitude_thrust"
    size: ClassVar[int] = 4
    choices: ClassVar[int | None] = None

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        attitude = action_terms.attitude(
            action,
            flight.state.attitude,
            tilt_rad=self.tilt_rad,
            yaw_rate_rad_s=self.yaw_rate_rad_s,
            ahead_s=1.0 / flight.decision_rate_hz,
        )
        flight.envs.command_attitude(attitude, _thrust(flight, action))


@dataclass(frozen=True)
class RatesThrust:
    """Body rates and thrust: 0 is the thrust of hover, -1 none, 1 twice that."""

    rate_rad_s: float = 2.0 * math.pi
    kind: ClassVar[str] = "rates_thrust"
    size: ClassVar[int] = 4
    choices: ClassVar[int | None] = None

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        flight.envs.command_rates(self.rate_rad_s * action[..., :3], _thrust(flight, action))


@dataclass(frozen=True)
class RotorSpeeds:
    """Speeds of the rotors: 0 is the speed of hover, 1 the maximum, -1 standstill."""

    rotors: int = 4
    kind: ClassVar[str] = "rotor_speeds"
    choices: ClassVar[int | None] = None

    @property
    def size(self) -> int:
        """Numbers in the action of one UAV."""
        return self.rotors

    def command(self, flight: Flight, action: Array) -> None:
        """Commands all UAVs; see `Action.command`."""
        rotors = flight.airframe.rotors
        hover = np.sqrt(hover_thrusts(flight.airframe) / rotors.thrust_n_s2)
        speeds = action_terms.rotor_speeds(action, hover, rotors.max_speed_rad_s)
        flight.envs.command_rotor_speeds(speeds)


def _thrust(flight: Flight, action: Array) -> Array:
    """Returns thrusts (K, n), N, of the last number of each action."""
    airframe = flight.airframe
    max_thrust = airframe.max_rotor_thrust * len(airframe.rotors.places)
    return action_terms.thrust(action[..., 3], airframe.weight, max_thrust)
