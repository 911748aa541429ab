"""The motion with which environments start in the air."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from volery.control.flying_start import FlyingStart
from volery.control.setpoints import MAX_COORDINATE, checked
from volery.core.arrays import Array
from volery.core.errors import CommandError


@dataclass(frozen=True)
class EnvironmentStart:
    """Motion in which UAVs start in the air, without a take-off.

    Arrays broadcast to (R, n, ...), for R environments that are reset and n UAVs in each. Rotors
    turn as in hover. A UAV brakes and holds until its first command.
    """

    position_map: ArrayLike
    """Positions (R, n, 3), m, in the map frame."""
    attitude: ArrayLike = (0.0, 0.0, 0.0, 1.0)
    """Attitudes (R, n, 4), unit quaternions x y z w, map from body."""
    velocity_map: ArrayLike = (0.0, 0.0, 0.0)
    """Velocities (R, n, 3), m/s, in the map frame."""
    omega_body: ArrayLike = (0.0, 0.0, 0.0)
    """Body rates (R, n, 3), rad/s, FLU."""

    def spread(self, envs: int, uavs: int) -> FlyingStart:
        """Returns the motion of each UAV, a row each, environment by environment.

        Raises `CommandError` if an array does not broadcast, is not finite or is out of range.
        """

        def rows(what: str, values: ArrayLike, width: int, limit: float) -> Array:
            shape = (envs, uavs, width)
            try:
                array = np.broadcast_to(np.asarray(values, np.float64), shape)
            except (TypeError, ValueError):
                raise CommandError(
                    f"{what} of the start: numbers that broadcast to {shape} are needed, not shape "
                    f"{np.shape(values)}"
                ) from None
            return checked(
                f"{what} of the start", array.reshape(-1, width), (envs * uavs, width), limit
            )

        attitude = rows("attitude", self.attitude, 4, 1.1)
        length = np.linalg.norm(attitude, axis=1, keepdims=True)
        if len(length) and not 0.9 < length.min() <= length.max() < 1.1:
            raise CommandError("attitude of the start must be unit quaternions x y z w")
        return FlyingStart(
            rows("position", self.position_map, 3, MAX_COORDINATE),
            attitude / length,
            rows("velocity", self.velocity_map, 3, 100.0),
            rows("rates", self.omega_body, 3, 100.0),
        )
