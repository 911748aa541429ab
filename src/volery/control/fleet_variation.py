"""Physical parameters of single UAVs of a fleet that differ from their airframe's.

Each UAV gets a model of its own in the table of models and a weather of its own, on the first
change; fleets without changes share these. Controllers do not know the differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.errors import CommandError
from volery.vehicle.airframe import GRAVITY, MAX_ROTORS, Airframe, allocation_matrix
from volery.vehicle.plant_types import RIGID_BODY
from volery.world.weather.mean_wind import UNIFORM


class FleetParameters(NamedTuple):
    """Parameters of K UAVs; None leaves a parameter as it is."""

    wind_map: Array | None = None
    """(K, 3) m/s, map."""
    turbulence_m_s: Array | None = None
    """(K,) mean wind at 20 ft, m/s."""
    mass_kg: Array | None = None
    """(K,)."""
    inertia_kg_m2: Array | None = None
    """(K, 3) about x, y, z, FLU."""
    rotor_thrust: Array | None = None
    """(K, rotors) fractions of a new rotor's thrust."""
    motor_delay: Array | None = None
    """(K, rotors or 1) factors of the motors' time constants."""

    def rows(self, chosen: NDArray[np.int64]) -> FleetParameters:
        """Returns the parameters of the UAVs `chosen` of these."""
        return FleetParameters(*(None if a is None else a[chosen] for a in self))

    @property
    def changes_model(self) -> bool:
        """Whether any parameter of the vehicles themselves is set."""
        return any(array is not None for array in self[2:])

    @property
    def changes_air(self) -> bool:
        """Whether any parameter of the air is set."""
        return any(array is not None for array in self[:2])


class FleetVariation:
    """The differences of N UAVs, rows of `uavs`.

    models: the fleet's table of models, which `own_models` replaces. dt: physics step, s.
    """

    def __init__(self, airframes: Sequence[Airframe], uavs: NDArray[np.void], dt: float) -> None:
        self._uavs = uavs
        self._dt = dt
        count = len(airframes)
        self.wind_map = np.full((count, 3), np.nan)
        """(N, 3) m/s, map; nan: that of the weather."""
        self.turbulence_m_s = np.full(count, np.nan)
        """(N,) m/s at 20 ft; nan: that of the weather."""
        self.rotor_thrust = np.full((count, MAX_ROTORS), np.nan)
        """(N, MAX_ROTORS) health of the rotors at a restart; nan: that of the start."""
        self.hover_speed = np.full((count, MAX_ROTORS), np.nan)
        """(N, MAX_ROTORS) rad/s of the rotors at a start in the air; nan: that of the airframe."""
        self._hover_fraction = np.zeros((count, MAX_ROTORS))
        """(N, MAX_ROTORS) each rotor's part of the thrust in hover."""
        self._times = {"rise": np.zeros(count), "fall": np.zeros(count)}
        """(N,) s, time constants of the motors."""
        self._fill_tables(airframes)

    @property
    def has_air(self) -> bool:
        """Whether any UAV has a wind of its own."""
        return not (np.isnan(self.wind_map).all() and np.isnan(self.turbulence_m_s).all())

    def set_air(self, rows: NDArray[np.int64], parameters: FleetParameters) -> None:
        """Sets the winds of the UAVs `rows` (K,)."""
        if parameters.wind_map is not None:
            self.wind_map[rows] = parameters.wind_map
        if parameters.turbulence_m_s is not None:
            self.turbulence_m_s[rows] = parameters.turbulence_m_s

    def air_of(self, common: NDArray[np.void]) -> NDArray[np.void]:
        """Returns the weather (N,) of each UAV; common: (1,) that of the fleet."""
        air = np.repeat(common, len(self._uavs))
        self.write_air(air, np.arange(len(air)))
        return air

    def write_air(self, air: NDArray[np.void], rows: NDArray[np.int64]) -> None:
        """Writes the winds of the UAVs `rows` (K,) into the weather (N,) of each UAV."""
        own = rows[~np.isnan(self.wind_map[rows, 0])]
        air["velocity"][own] = self.wind_map[own]
        stirred = rows[~np.isnan(self.turbulence_m_s[rows])]
        air["w20"][stirred] = self.turbulence_m_s[stirred]
        is_uniform = (air["kind"][rows] == UNIFORM) & (air["gusts"][rows] == 0)
        air["steady"][rows] = is_uniform & (air["w20"][rows] == 0.0)

    def set_models(
        self, models: NDArray[np.void], rows: NDArray[np.int64], parameters: FleetParameters
    ) -> None:
        """Changes the models of the UAVs `rows` (K,) in the table `models`, one for each UAV.

        Raises `CommandError` if one is no rigid body.
        """
        if (models["kind"][rows] != RIGID_BODY).any():
            raise CommandError("only rigid bodies have masses, inertia and rotors that vary")
        plant: Any = models["plant"]
        _, mass, inertia = parameters[1:4]
        if mass is not None:
            plant["inverse_mass"][rows] = 1.0 / mass
            self._set_hover_speeds(plant, rows, mass)
        if inertia is not None:
            plant["inverse_inertia"][rows] = 1.0 / inertia
            rolled = np.roll(inertia, 1, axis=1) - np.roll(inertia, -1, axis=1)
            plant["gyroscopic"][rows] = rolled / inertia
        if parameters.motor_delay is not None:
            self._set_delays(plant, rows, parameters.motor_delay)
        if parameters.rotor_thrust is not None:
            width = parameters.rotor_thrust.shape[1]
            self.rotor_thrust[rows, :width] = parameters.rotor_thrust

    def fit(self, models: NDArray[np.void], rows: NDArray[np.int64]) -> None:
        """Applies rotor thrusts, and in the air hover speeds, to the restarted UAVs `rows` (K,)."""
        bodies: Any = self._uavs["body"]
        worn = rows[~np.isnan(self.rotor_thrust[rows, 0])]
        if len(worn):
            plant: Any = models["plant"][worn]
            has = np.arange(MAX_ROTORS) < plant["rotors"][:, None]
            health = np.where(has, self.rotor_thrust[worn], 0.0)
            bodies["rotor_health"][worn] = health
            bodies["rotor_lift"][worn] = plant["thrust_constant"][:, None] * health
            bodies["altered"][worn] = ((health != 1.0) & has).any(axis=1)
        turns = bodies["rotor_speed"][rows].any(axis=1)
        heavy = rows[turns & ~np.isnan(self.hover_speed[rows, 0])]
        if len(heavy):
            bodies["rotor_speed"][heavy] = self.hover_speed[heavy]
            self._uavs["control_state"]["rotor_reference"][heavy] = self.hover_speed[heavy]

    def get_state(self) -> dict[str, Array]:
        """Returns copies of all differences."""
        names = ("wind_map", "turbulence_m_s", "rotor_thrust", "hover_speed")
        return {name: getattr(self, name).copy() for name in names}

    def set_state(self, state: dict[str, Array]) -> None:
        """Restores a state of `get_state`."""
        for name, array in state.items():
            getattr(self, name)[:] = array

    def restore(self, state: dict[str, Array] | None, rows: NDArray[np.int64]) -> None:
        """Restores the UAVs `rows` from a state of `get_state`; None: they have no differences."""
        for name in self.get_state():
            getattr(self, name)[rows] = np.nan if state is None else state[name][rows]

    def _set_hover_speeds(self, plant: Any, rows: NDArray[np.int64], mass: Array) -> None:
        thrusts = self._hover_fraction[rows] * (mass * GRAVITY)[:, None]
        self.hover_speed[rows] = np.sqrt(thrusts / plant["thrust_constant"][rows, None])

    def _set_delays(self, plant: Any, rows: NDArray[np.int64], factor: Array) -> None:
        """Sets the lags of motors by factors (K, rotors or 1)."""
        width = MAX_ROTORS if factor.shape[1] == 1 else factor.shape[1]
        for name, times in self._times.items():
            time = factor * times[rows, None]
            for field, dt in ((name, self._dt), (f"{name}_half", 0.5 * self._dt)):
                plant[field][rows, :width] = np.exp(-dt / time)

    def _fill_tables(self, airframes: Sequence[Airframe]) -> None:
        kinds = {id(airframe): airframe for airframe in airframes}
        numbers = np.array([id(airframe) for airframe in airframes])
        for number, airframe in kinds.items():
            rows = numbers == number
            column = allocation_matrix(airframe)[:, 0]
            self._hover_fraction[rows, : len(column)] = column
            for name, times in self._times.items():
                times[rows] = getattr(airframe.rotors, f"{name}_time_s")
