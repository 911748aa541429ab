"""Barometers: pressure of the standard atmosphere at the sensor's altitude, noise and drift.

Layers of air are parallel to the map's x-y plane, as gravity is normal to it: the altitude above
sea level is that of the scenario's origin plus z.
"""

from __future__ import annotations

import math
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat, PositiveFloat, model_validator

from volery.control.fleet import Fleet
from volery.core import atmosphere, rotations
from volery.core.arrays import read_only
from volery.core.clock import NS_PER_S
from volery.sensors.bank import NoisyBank, SensorGroup
from volery.sensors.model import SensorModel
from volery.sensors.noise import gauss_markov_of_sigma
from volery.sensors.samples import PressureSamples


class BarometerModel(SensorModel):
    """Noise, drift and range in Pa; see the data files in `models/`."""

    sensor_kind: ClassVar = "barometer"

    name: str
    noise_pa: NonNegativeFloat
    drift_pa: NonNegativeFloat
    """Long-run standard deviation of the drift, Pa."""
    drift_correlation_s: PositiveFloat
    range_min_pa: NonNegativeFloat = 0.0
    """Lowest pressure that the sensor reports."""
    range_max_pa: PositiveFloat | None = None
    """Highest pressure that the sensor reports; None: unlimited."""

    @model_validator(mode="after")
    def _range_is_ordered(self) -> Self:
        if self.range_max_pa is not None and not self.range_min_pa < self.range_max_pa:
            raise ValueError("range_min_pa must be less than range_max_pa")
        return self


class BarometerBank(NoisyBank):
    """All barometers of one model, rate and phase.

    `origin_altitude_m` is the map's height above sea level.
    """

    name = "barometer"
    lag_ns = 0
    _SAVED = ("_drift",)

    def __init__(
        self,
        model: BarometerModel,
        group: SensorGroup,
        origin_altitude_m: float,
    ) -> None:
        super().__init__(group, at_start=1, per_measurement=2)
        self._model = model
        self._position_body = group.position_body
        self._origin_altitude = origin_altitude_m
        self._wander = gauss_markov_of_sigma(
            model.drift_pa, model.drift_correlation_s, group.schedule.period_ns / NS_PER_S
        )
        self._drift = self._wander.sigma * self._noise.start()[:, 0]

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> PressureSamples:
        """Returns pressures (S,) Pa and temperatures (S,) K of measurement `k`; see `Bank`."""
        lever = rotations.rotate(fleet.state.attitude[self._rows], self._position_body)
        z = fleet.state.position_map[self._rows, 2] + lever[:, 2]
        pressure = atmosphere.pressure(self._origin_altitude + z)
        noise = self._noise.measurement(k)
        pressure += self._drift + self._model.noise_pa * noise[:, 0]
        self._drift = self._wander.decay * self._drift + self._wander.step * noise[:, 1]
        np.maximum(pressure, self._model.range_min_pa, out=pressure)
        np.minimum(pressure, self._model.range_max_pa or math.inf, out=pressure)
        return PressureSamples(
            self.sensors,
            time_ns,
            read_only(pressure),
            read_only(atmosphere.temperature(self._origin_altitude + z)),
            self._model.noise_pa**2 if self._noise.enabled else 0.0,
        )

    def _switch_on(self, rows: NDArray[np.int64], time_ns: int) -> None:  # noqa: ARG002
        """Draws a new drift."""
        self._drift[rows] = self._wander.sigma * self._noise.start()[rows, 0]
