"""Odometry: where a UAV believes it is. And the ground truth that reports compare it with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat

from volery.control.fleet import Fleet
from volery.core import rng, rotations
from volery.core.clock import Schedule
from volery.sensors.inertial_kernels import body_twists
from volery.sensors.model import SensorModel, load_model
from volery.sensors.samples import OdometryReadings, SensorId, owned

Array = NDArray[np.float64]
_NUMBERS_A_SAMPLE = 10


class OdometryModel(SensorModel):
    """Drift and noise; see the data files in `models/`."""

    name: str
    horizontal_drift_m_sqrt_m: NonNegativeFloat
    vertical_drift_m_sqrt_m: NonNegativeFloat
    yaw_drift_rad_sqrt_m: NonNegativeFloat
    velocity_noise_m_s: NonNegativeFloat
    rate_noise_rad_s: NonNegativeFloat


def load_odometry_model(name: str, folder: Path | None = None) -> OdometryModel:
    """Model by shipped name or `.toml` path."""
    return load_model(OdometryModel, "odometry", name, folder)


class OdometryBank:
    """All odometry sources of one model, rate and phase.

    The pose error is a random walk over the distance flown; the odometry frame coincides with the
    map at the start. `keys` (S,) are the noise streams, or None for perfect odometry.
    """

    name = "odometry"
    lag_ns = 0

    def __init__(
        self,
        model: OdometryModel,
        schedule: Schedule,
        sensors: tuple[SensorId, ...],
        keys: NDArray[np.uint64] | None,
        fleet: Fleet,
    ) -> None:
        self.schedule = schedule
        self.sensors = sensors
        self._rows = np.array([s.uav for s in sensors])
        self._keys = keys
        horizontal, vertical = model.horizontal_drift_m_sqrt_m, model.vertical_drift_m_sqrt_m
        self._drift = np.array([horizontal, horizontal, vertical, model.yaw_drift_rad_sqrt_m])
        self._twist_noise = np.repeat([model.velocity_noise_m_s, model.rate_noise_rad_s], 3)
        self._error = np.zeros((len(sensors), 4))
        self._flown = np.zeros(len(sensors))
        self._last_position = fleet.state.position_map[self._rows].copy()

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> OdometryReadings:
        """Reading number k (counted from 0) of all sources of the bank."""
        position = fleet.state.position_map[self._rows]
        attitude = fleet.state.attitude[self._rows]
        moved = np.linalg.norm(position - self._last_position, axis=1)
        self._last_position = position.copy()
        self._flown += moved
        twist = _twist_body(fleet, self._rows)
        variance = np.zeros((len(self._rows), 6))
        if self._keys is not None:
            noise = np.empty((len(self._rows), _NUMBERS_A_SAMPLE))
            rng.fill_normal(self._keys, _NUMBERS_A_SAMPLE * k, noise)
            self._error += np.sqrt(moved)[:, None] * self._drift * noise[:, :4]
            twist += self._twist_noise * noise[:, 4:]
            variance[:, [0, 1, 2, 5]] = self._flown[:, None] * self._drift**2
        yaw_error = rotations.exponential(self._error[:, 3:] * np.array([0.0, 0.0, 1.0]))
        return OdometryReadings(
            self.sensors,
            time_ns,
            owned(position + self._error[:, :3]),
            owned(rotations.multiply(yaw_error, attitude)),
            owned(twist[:, :3].copy()),
            owned(twist[:, 3:].copy()),
            owned(variance),
            owned(np.tile(self._twist_noise**2, (len(self._rows), 1))),
            is_ground_truth=False,
        )

    def get_state(self) -> dict[str, Any]:
        """What a snapshot keeps."""
        kept = {"error": self._error, "flown": self._flown, "last_position": self._last_position}
        return {name: array.copy() for name, array in kept.items()}

    def set_state(self, state: dict[str, Any]) -> None:
        """Go back to a kept state."""
        self._error = np.array(state["error"])
        self._flown = np.array(state["flown"])
        self._last_position = np.array(state["last_position"])


class GroundTruthBank:
    """The true poses and twists."""

    name = "ground_truth"
    lag_ns = 0

    def __init__(self, schedule: Schedule, sensors: tuple[SensorId, ...]) -> None:
        self.schedule = schedule
        self.sensors = sensors
        self._rows = np.array([s.uav for s in sensors])

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> OdometryReadings:  # noqa: ARG002
        """The present state of all UAVs of the bank."""
        twist = _twist_body(fleet, self._rows)
        zero = np.zeros((len(self._rows), 6))
        return OdometryReadings(
            self.sensors,
            time_ns,
            owned(fleet.state.position_map[self._rows].copy()),
            owned(fleet.state.attitude[self._rows].copy()),
            owned(twist[:, :3].copy()),
            owned(twist[:, 3:].copy()),
            owned(zero),
            owned(zero.copy()),
            is_ground_truth=True,
        )


def _twist_body(fleet: Fleet, rows: NDArray[np.int64]) -> Array:
    state = fleet.state
    twist = np.empty((len(rows), 6))
    body_twists(rows, state.attitude, state.velocity_map, state.omega_body, twist)
    return twist
