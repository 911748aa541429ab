"""Magnetometers: the field in the sensor frame, iron, noise, a drifting bias, full scale."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat, PositiveFloat

from volery.control.fleet import Fleet
from volery.core.arrays import Array, read_only
from volery.core.clock import NS_PER_S
from volery.sensors.bank import NoisyBank, SensorGroup, saturate
from volery.sensors.inertial_kernels import feel_vector
from volery.sensors.model import SensorModel
from volery.sensors.noise import gauss_markov
from volery.sensors.samples import MagneticSamples

Row = tuple[float, float, float]


class MagnetometerModel(SensorModel):
    """Iron, noise and range; see the data files in `models/`."""

    sensor_kind: ClassVar = "magnetometer"

    name: str
    noise_density_t_sqrt_hz: NonNegativeFloat
    random_walk_t_s_sqrt_hz: NonNegativeFloat
    bias_correlation_s: PositiveFloat
    hard_iron_t: Row = (0.0, 0.0, 0.0)
    """Field of magnetised parts, T, in the sensor frame."""
    soft_iron: tuple[Row, Row, Row] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    """Distortion of the outer field by magnetisable parts, in the sensor frame."""
    range_t: tuple[PositiveFloat, PositiveFloat, PositiveFloat] | None = None
    """Full scale on each axis, T; None: unlimited."""


class MagnetometerBank(NoisyBank):
    """All magnetometers of one model, rate and phase.

    `field_map` (3,) T is the uniform field in the map frame.
    """

    name = "magnetometer"
    lag_ns = 0
    _SAVED = ("_bias",)

    def __init__(self, model: MagnetometerModel, group: SensorGroup, field_map: Array) -> None:
        super().__init__(group, per_measurement=6)
        self._body_from_sensor = group.attitude_body
        self._field_map = field_map
        self._hard_iron = np.array(model.hard_iron_t)
        self._soft_iron = np.array(model.soft_iron)
        dt = group.schedule.period_ns / NS_PER_S
        self._white = model.noise_density_t_sqrt_hz / math.sqrt(dt)
        self._wander = gauss_markov(model.random_walk_t_s_sqrt_hz, model.bias_correlation_s, dt)
        self._bias = np.zeros((len(group.sensors), 3))
        self._full_scale = np.array(model.range_t or 3 * [math.inf])

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> MagneticSamples:
        """Returns fields (S, 3) T in the sensor frames, of measurement `k`; see `Bank`."""
        outer = np.empty((len(self._rows), 3))
        feel_vector(
            self._rows, fleet.state.attitude, self._body_from_sensor, self._field_map, outer
        )
        field = outer @ self._soft_iron.T + self._hard_iron
        noise = self._noise.measurement(k)
        field += self._bias + self._white * noise[:, :3]
        self._bias = self._wander.decay * self._bias + self._wander.step * noise[:, 3:]
        saturate(field, self._full_scale)
        return MagneticSamples(
            self.sensors,
            time_ns,
            read_only(field),
            self._white**2 if self._noise.enabled else 0.0,
        )

    def _switch_on(self, rows: NDArray[np.int64], time_ns: int) -> None:  # noqa: ARG002
        """Clears the bias."""
        self._bias[rows] = 0.0
