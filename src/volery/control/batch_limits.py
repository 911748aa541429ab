"""Limits of the commands to many UAVs at once, as arrays, and the checks against them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from volery.control.setpoints import MAX_COORDINATE
from volery.core.arrays import Array
from volery.core.errors import CommandError
from volery.vehicle.airframe import Airframe
from volery.vehicle.identified import IdentifiedModel
from volery.vehicle.kinematic import Kinematic
from volery.vehicle.plant_types import Plant

MAX_SPEED = 1e3
"""Maximum velocity, m/s, and acceleration, m/s^2, of a command."""
MAX_YAW_RATE = 100.0
"""Maximum yaw rate of a command, rad/s."""
MAX_YAW = 1e4
"""Maximum heading of a command, rad."""


class BatchLimits:
    """Limits of N UAVs, computed once; `FleetCommands` has the same for single UAVs.

    names: of the UAVs, for errors. Every check raises `CommandError` for the first UAV with a
    value that is not finite or out of range.
    """

    def __init__(
        self, airframes: Sequence[Airframe], plants: Sequence[Plant], names: Sequence[str]
    ) -> None:
        self._plants = plants
        self._names = names
        counts = np.array([len(airframe.rotors.places) for airframe in airframes])
        self.num_rotors = int(counts.max())
        """Largest number of rotors."""
        self._has_rotor: NDArray[np.bool_] = np.arange(self.num_rotors) < counts[:, None]
        self._rotor_speed = _column(airframe.rotors.max_speed_rad_s for airframe in airframes)
        self._rate = _column(4.0 * math.radians(a.limits.rate_deg_s) for a in airframes)
        self._thrust = _column(len(a.rotors.places) * a.max_rotor_thrust for a in airframes)[:, 0]
        self._refusals: dict[str, str | None] = {}

    def rotor_speeds(self, speeds: Array) -> Array:
        """Returns rotor speeds (N, R) rad/s, 0 in the columns beyond a UAV's rotors."""
        self._refuse_plants("rotor speeds", IdentifiedModel, Kinematic)
        if not self._has_rotor.all():
            speeds = np.where(self._has_rotor, speeds, 0.0)
        return self._within("rotor speeds", speeds, 0.0, self._rotor_speed)

    def rates(self, omega_body: Array) -> Array:
        """Returns body rates (N, 3) rad/s."""
        self._refuse_plants("rates", IdentifiedModel, Kinematic)
        return self._within("rates", omega_body, -self._rate, self._rate)

    def thrusts(self, thrust: Array) -> Array:
        """Returns thrusts (N,) N."""
        return self._within("thrust", thrust, 0.0, self._thrust)

    def attitudes(self, attitude: Array) -> Array:
        """Returns unit quaternions (N, 4); normalises lengths between 0.9 and 1.1."""
        self._refuse_plants("attitudes", Kinematic)
        length = np.linalg.norm(attitude, axis=1)
        self._within("length of attitude", length, 0.9, 1.1)
        return np.asarray(attitude / length[:, None])

    def positions(self, position: Array) -> Array:
        """Returns positions (N, 3) m."""
        return self._within("position", position, -MAX_COORDINATE, MAX_COORDINATE)

    def velocities(self, velocity: Array) -> Array:
        """Returns velocities (N, 3) m/s."""
        return self._within("velocity", velocity, -MAX_SPEED, MAX_SPEED)

    def accelerations(self, acceleration: Array) -> Array:
        """Returns accelerations (N, 3) m/s^2."""
        return self._within("acceleration", acceleration, -MAX_SPEED, MAX_SPEED)

    def yaws(self, yaw: Array) -> Array:
        """Returns headings (N,) rad."""
        return self._within("yaw", yaw, -MAX_YAW, MAX_YAW)

    def yaw_rates(self, yaw_rate: Array) -> Array:
        """Returns yaw rates (N,) rad/s."""
        return self._within("yaw rate", yaw_rate, -MAX_YAW_RATE, MAX_YAW_RATE)

    # ------------------------------------------------------------------------------------- inside

    def _within(self, what: str, values: Array, low: Array | float, high: Array | float) -> Array:
        """Returns the values (N,) or (N, k) if all are within the limits (nan is not)."""
        is_right = (values >= low) & (values <= high)
        if not is_right.all():
            i = int(np.flatnonzero(~is_right.reshape(len(values), -1).all(axis=1))[0])
            lowest, highest = (float(np.ravel(limit)[i % np.size(limit)]) for limit in (low, high))
            raise CommandError(
                f"{what} = {values[i].tolist()} of {self._names[i]} is out of range; finite "
                f"numbers from {lowest:.6g} to {highest:.6g} are allowed"
            )
        return values

    def _refuse_plants(self, what: str, *plants: type[Plant]) -> None:
        """Raises `CommandError` if any UAV has one of these plants, which lack a command."""
        if what not in self._refusals:
            pairs = zip(self._names, self._plants, strict=True)
            refusing = (pair for pair in pairs if isinstance(pair[1], plants))
            name, plant = next(refusing, ("", None))
            self._refusals[what] = (
                f"{name} does not accept {what}: its plant is a {type(plant).__name__}"
                if name
                else None
            )
        refusal = self._refusals[what]
        if refusal is not None:
            raise CommandError(refusal)


def _column(values: Iterable[float]) -> Array:
    return np.array([*values], dtype=np.float64)[:, None]
