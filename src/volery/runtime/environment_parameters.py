"""Physical parameters of environments that differ from those of the scenario."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control.fleet_variation import FleetParameters
from volery.core.arrays import Array
from volery.core.errors import CommandError


@dataclass(frozen=True)
class EnvironmentParameters:
    """Parameters of R environments of n UAVs; None leaves a parameter as it is.

    Arrays broadcast to (R, n, ...). Controllers and the limits of commands do not know them.
    """

    wind_map: ArrayLike | None = None
    """(R, n, 3) m/s, map: steady wind, at the reference height of a wind profile."""
    turbulence_m_s: ArrayLike | None = None
    """(R, n) mean wind at 20 ft that sets the Dryden turbulence, m/s."""
    mass_kg: ArrayLike | None = None
    """(R, n)."""
    inertia_kg_m2: ArrayLike | None = None
    """(R, n, 3) about x, y, z, FLU."""
    rotor_thrust: ArrayLike | None = None
    """(R, n, rotors) fractions, 0 to 1, of a new rotor's thrust."""
    motor_delay: ArrayLike | None = None
    """(R, n, rotors) factors of the motors' time constants."""

    def spread(self, envs: int, uavs: int) -> FleetParameters:
        """Returns the parameters of each UAV, a row each, environment by environment.

        Raises `CommandError` for an array that does not broadcast, is not finite or out of range.
        """

        def rows(name: str, width: int | None, low: float, high: float) -> Array | None:
            values = getattr(self, name)
            if values is None:
                return None
            array = np.asarray(values, np.float64)
            own = (array.shape[-1] if array.ndim else 1,) if width == -1 else (width,)
            shape = (envs, uavs) if width is None else (envs, uavs, *own)
            try:
                array = np.broadcast_to(array, shape)
            except ValueError:
                raise CommandError(
                    f"{name} of shape {array.shape} does not broadcast to {shape}"
                ) from None
            if not ((array >= low) & (array <= high)).all():
                raise CommandError(f"{name}: finite numbers from {low:g} to {high:g} are needed")
            return array.reshape(envs * uavs, *shape[2:])

        return FleetParameters(
            rows("wind_map", 3, -200.0, 200.0),
            rows("turbulence_m_s", None, 0.0, 100.0),
            rows("mass_kg", None, 1e-4, 1e4),
            rows("inertia_kg_m2", 3, 1e-9, 1e5),
            rows("rotor_thrust", -1, 0.0, 1.0),
            rows("motor_delay", -1, 1e-3, 1e3),
        )

    def with_(self, other: EnvironmentParameters) -> EnvironmentParameters:
        """Returns these parameters with those of `other` that are set."""
        own = {f.name: getattr(other, f.name) for f in fields(other)}
        return replace(self, **{name: value for name, value in own.items() if value is not None})


def rows_of_environments(envs: NDArray[np.int64], num_uavs: int) -> NDArray[np.int64]:
    """Returns the rows (R * n,) of the UAVs of environments (R,)."""
    return (envs[:, None] * num_uavs + np.arange(num_uavs)).ravel()
