"""Inertial measurement units: discrete noise and bias model of PX4 and RotorS.

White noise N / sqrt(dt); bias a first-order Gauss-Markov process with correlation time tau: b+ =
exp(-dt/tau) b + sigma sqrt(tau/2 (1 - exp(-2 dt/tau))) n. A turn-on bias is drawn once and
constant. A sensor may also warm up: a bias drawn once that decays as exp(-t / time constant). What
the sensor reports, errors included, ends at its full scale on each axis.
"""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, NonNegativeFloat, PositiveFloat

from volery.control.fleet import Fleet
from volery.core.arrays import Array, read_only
from volery.core.clock import NS_PER_S
from volery.sensors.bank import NoisyBank, SensorGroup, saturate
from volery.sensors.inertial_kernels import feel_motion
from volery.sensors.model import SensorModel
from volery.sensors.noise import add_errors, gauss_markov
from volery.sensors.samples import ImuSamples

_MIN_ACCEL_RANGE_M_S2 = 19.6
"""2 g, the smallest full scale of data sheets; so a range in g, such as 16, is refused."""
_MAX_GYRO_RANGE_RAD_S = 349.1
"""20,000 deg/s, the largest full scale (ADXRS649); so one in deg/s, such as 2000, is refused."""


class ImuModel(SensorModel):
    """Noise and ranges of an IMU; see the data files in `models/`."""

    sensor_kind: ClassVar = "IMU"

    name: str
    gyro_noise_density_rad_s_sqrt_hz: NonNegativeFloat
    gyro_random_walk_rad_s2_sqrt_hz: NonNegativeFloat
    gyro_bias_correlation_s: PositiveFloat
    gyro_turn_on_bias_rad_s: NonNegativeFloat
    accel_noise_density_m_s2_sqrt_hz: NonNegativeFloat
    accel_random_walk_m_s3_sqrt_hz: NonNegativeFloat
    accel_bias_correlation_s: PositiveFloat
    accel_turn_on_bias_m_s2: NonNegativeFloat
    gyro_warm_up_bias_rad_s: NonNegativeFloat = 0.0
    """Standard deviation of a cold sensor's bias, in addition to the turn-on bias."""
    accel_warm_up_bias_m_s2: NonNegativeFloat = 0.0
    warm_up_time_constant_s: PositiveFloat = 60.0
    gyro_range_rad_s: Annotated[float, Field(gt=0.0, le=_MAX_GYRO_RANGE_RAD_S)] | None = None
    """Full scale of the gyroscope on each axis, up to 20,000 deg/s; None: unlimited."""
    accel_range_m_s2: Annotated[float, Field(ge=_MIN_ACCEL_RANGE_M_S2)] | None = None
    """Full scale of the accelerometer on each axis, from 2 g on; None: unlimited."""


class ImuBank(NoisyBank):
    """All IMUs of one model, rate and phase."""

    name = "imu"
    lag_ns = 0
    _SAVED = ("_bias", "_turn_on_bias", "_warm_up_bias", "_start_ns")

    def __init__(self, model: ImuModel, group: SensorGroup) -> None:
        super().__init__(group, at_start=12, per_measurement=12)
        self._position_body = group.position_body
        self._body_from_sensor = group.attitude_body
        count, dt = len(group.sensors), group.schedule.period_ns / NS_PER_S
        self._white = _axes(
            model.gyro_noise_density_rad_s_sqrt_hz, model.accel_noise_density_m_s2_sqrt_hz
        ) / math.sqrt(dt)
        self._wander = gauss_markov(
            _axes(model.gyro_random_walk_rad_s2_sqrt_hz, model.accel_random_walk_m_s3_sqrt_hz),
            _axes(model.gyro_bias_correlation_s, model.accel_bias_correlation_s),
            dt,
        )
        self._turn_on = _axes(model.gyro_turn_on_bias_rad_s, model.accel_turn_on_bias_m_s2)
        self._is_cold = model.gyro_warm_up_bias_rad_s > 0.0 or model.accel_warm_up_bias_m_s2 > 0.0
        self._cold = _axes(model.gyro_warm_up_bias_rad_s, model.accel_warm_up_bias_m_s2)
        self._warm_up_s = model.warm_up_time_constant_s
        self._full_scale = _axes(
            model.gyro_range_rad_s or math.inf, model.accel_range_m_s2 or math.inf
        )
        self._bias = np.zeros((count, 6))
        self._turn_on_bias = np.zeros((count, 6))
        self._warm_up_bias = np.zeros((count, 6))
        self._start_ns = np.zeros(count, np.int64)
        self._switch_on(np.arange(count), 0)

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> ImuSamples:
        """Returns rates (rad/s) and specific forces (m/s^2), (S, 3) each, in the sensor frames.

        They belong to measurement number `k`; see `Bank`.
        """
        state = fleet.state
        reading = np.empty((len(self._rows), 6))
        feel_motion(
            self._rows,
            state.attitude,
            state.omega_body,
            state.acceleration_map,
            state.angular_acceleration_body,
            self._position_body,
            self._body_from_sensor,
            reading,
        )
        if self._noise.enabled:
            add_errors(
                reading,
                self._noise.measurement(k),
                self._turn_on_bias,
                self._bias,
                self._white,
                self._wander.decay,
                self._wander.step,
            )
            if self._is_cold:
                age_s = (time_ns - self._start_ns) / NS_PER_S
                reading += self._warm_up_bias * np.exp(-age_s / self._warm_up_s)[:, None]
        saturate(reading, self._full_scale)
        return ImuSamples(
            self.sensors,
            time_ns,
            read_only(reading[:, :3].copy()),
            read_only(reading[:, 3:].copy()),
            float(self._white[0] ** 2),
            float(self._white[3] ** 2),
        )

    def _switch_on(self, rows: NDArray[np.int64], time_ns: int) -> None:
        drawn = self._noise.start()[rows]
        self._bias[rows] = 0.0
        self._turn_on_bias[rows] = self._turn_on * drawn[:, :6]
        self._warm_up_bias[rows] = self._cold * drawn[:, 6:]
        self._start_ns[rows] = time_ns


def _axes(gyro: float, accel: float) -> Array:
    return np.repeat([gyro, accel], 3)
