"""Inertial measurement units: discrete noise and bias model of PX4 and RotorS.

White noise N / sqrt(dt); bias a first-order Gauss-Markov process with correlation time tau:
b+ = exp(-dt/tau) b + sigma sqrt(tau/2 (1 - exp(-2 dt/tau))) n; a turn-on bias drawn once.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat, PositiveFloat

from volery.control.fleet import Fleet
from volery.core import rng
from volery.core.clock import NS_PER_S, Schedule
from volery.sensors.inertial_kernels import feel_motion
from volery.sensors.model import SensorModel, load_model
from volery.sensors.samples import ImuReadings, SensorId, owned

Array = NDArray[np.float64]


class ImuModel(SensorModel):
    """Noise of an IMU; see the data files in `models/`."""

    name: str
    gyro_noise_density_rad_s_sqrt_hz: NonNegativeFloat
    gyro_random_walk_rad_s2_sqrt_hz: NonNegativeFloat
    gyro_bias_correlation_s: PositiveFloat
    gyro_turn_on_bias_rad_s: NonNegativeFloat
    accel_noise_density_m_s2_sqrt_hz: NonNegativeFloat
    accel_random_walk_m_s3_sqrt_hz: NonNegativeFloat
    accel_bias_correlation_s: PositiveFloat
    accel_turn_on_bias_m_s2: NonNegativeFloat


def load_imu_model(name: str, folder: Path | None = None) -> ImuModel:
    """Model by shipped name or `.toml` path."""
    return load_model(ImuModel, "IMU", name, folder)


class ImuBank:
    """All IMUs of one model, rate and phase.

    `position_body` (S, 3) m and `attitude_body` (S, 4) place each sensor frame in its body (FLU);
    `keys` (S,) are the noise streams, or None for sensors without noise.
    """

    name = "imu"
    lag_ns = 0

    def __init__(
        self,
        model: ImuModel,
        schedule: Schedule,
        sensors: tuple[SensorId, ...],
        position_body: Array,
        attitude_body: Array,
        keys: NDArray[np.uint64] | None,
    ) -> None:
        self.schedule = schedule
        self.sensors = sensors
        self._model = model
        self._rows = np.array([s.uav for s in sensors])
        self._position_body = position_body
        self._body_from_sensor = attitude_body
        self._keys = keys
        self._bias = np.zeros((len(sensors), 6))
        dt = schedule.period_ns / NS_PER_S
        self._white = np.repeat(
            [model.gyro_noise_density_rad_s_sqrt_hz, model.accel_noise_density_m_s2_sqrt_hz], 3
        ) / math.sqrt(dt)
        self._decay, self._walk = _gauss_markov(model, dt)
        if keys is not None:
            turn_on = np.repeat([model.gyro_turn_on_bias_rad_s, model.accel_turn_on_bias_m_s2], 3)
            self._bias = turn_on * _draw(keys, 0)

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> ImuReadings:
        """Reading number k (counted from 0) of all sensors of the bank."""
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
        if self._keys is not None:
            noise = _draw(self._keys, 1 + 2 * k)
            reading += self._bias + self._white * noise
            self._bias = self._decay * self._bias + self._walk * _draw(self._keys, 2 + 2 * k)
        return ImuReadings(
            self.sensors,
            time_ns,
            owned(reading[:, :3].copy()),
            owned(reading[:, 3:].copy()),
            float(self._white[0] ** 2),
            float(self._white[3] ** 2),
        )

    def get_state(self) -> dict[str, Any]:
        """What a snapshot keeps."""
        return {"bias": self._bias.copy()}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state."""
        self._bias = np.array(state["bias"])


def _gauss_markov(model: ImuModel, dt: float) -> tuple[Array, Array]:
    tau = np.repeat([model.gyro_bias_correlation_s, model.accel_bias_correlation_s], 3)
    walk = np.repeat(
        [model.gyro_random_walk_rad_s2_sqrt_hz, model.accel_random_walk_m_s3_sqrt_hz], 3
    )
    decay = np.exp(-dt / tau)
    return decay, walk * np.sqrt(tau / 2.0 * (1.0 - decay**2))


def _draw(keys: NDArray[np.uint64], block: int) -> Array:
    out = np.empty((len(keys), 6))
    rng.fill_normal(keys, 6 * block, out)
    return out
