"""Odometry with drift, and the ground truth that reports compare it with."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.core.arrays import Array, read_only
from volery.core.rows import in_one_piece
from volery.sensors.bank import Memoryless, NoisyBank, SensorGroup
from volery.sensors.inertial_kernels import body_twists
from volery.sensors.model import SensorModel
from volery.sensors.samples import OdometrySamples

_NUMBERS_A_SAMPLE = 10


class OdometryModel(SensorModel):
    """Drift and noise; see the data files in `models/`."""

    sensor_kind: ClassVar = "odometry"

    name: str
    horizontal_drift_m_sqrt_m: NonNegativeFloat
    vertical_drift_m_sqrt_m: NonNegativeFloat
    yaw_drift_rad_sqrt_m: NonNegativeFloat
    velocity_noise_m_s: NonNegativeFloat
    rate_noise_rad_s: NonNegativeFloat


class OdometryBank(NoisyBank):
    """All odometry sources of one model, rate and phase.

    Each displacement is integrated as the source measures it: rotated by its yaw error so far, plus
    a random part. Both errors are random walks over the distance flown; the odometry frame
    coincides with the map at the start and at every reset. Without noise it is perfect.
    """

    name = "odometry"
    lag_ns = 0
    _SAVED = ("_position_odom", "_yaw_error", "_flown", "_last_position")

    def __init__(self, model: OdometryModel, group: SensorGroup, fleet: Fleet) -> None:
        super().__init__(group, per_measurement=_NUMBERS_A_SAMPLE)
        self._taken = in_one_piece(self._rows)
        self._fleet = fleet
        horizontal, vertical = model.horizontal_drift_m_sqrt_m, model.vertical_drift_m_sqrt_m
        self._drift = np.array([horizontal, horizontal, vertical, model.yaw_drift_rad_sqrt_m])
        self._growth = self._drift**2
        """Growth of the variances of position and yaw, m^2/m and rad^2/m."""
        self._twist_noise = np.repeat([model.velocity_noise_m_s, model.rate_noise_rad_s], 3)
        self._twist_variance = read_only(np.tile(self._twist_noise**2, (len(self._rows), 1)))
        self._position_odom = fleet.state.position_map[self._rows].copy()
        self._yaw_error = np.zeros(len(group.sensors))
        self._flown = np.zeros(len(group.sensors))
        self._last_position = self._position_odom.copy()

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> OdometrySamples:
        """Returns poses in the odometry frame and twists in the body frame (FLU), with variances.

        They belong to measurement number `k` of all S sources; see `Bank`.
        """
        position = fleet.state.position_map[self._taken]
        attitude = fleet.state.attitude[self._taken]
        offset = position - self._last_position
        moved = np.sqrt((offset * offset).sum(axis=1))
        self._last_position = position.copy()
        self._flown += moved
        self._position_odom += rotations.rotate(self._yaw_turn(), offset)
        twist = _twist_body(fleet, self._rows)
        variance = np.zeros((len(self._rows), 6))
        if self._noise.enabled:
            noise = self._noise.measurement(k)
            walk = np.sqrt(moved)[:, None] * self._drift * noise[:, :4]
            self._position_odom += walk[:, :3]
            self._yaw_error += walk[:, 3]
            twist += self._twist_noise * noise[:, 4:]
            grown = self._flown[:, None] * self._growth
            variance[:, :3], variance[:, 5] = grown[:, :3], grown[:, 3]
            # Effect of the yaw error on a straight path of any direction.
            variance[:, :2] += (self._growth[3] * self._flown**3 / 3.0)[:, None]
        return OdometrySamples(
            self.sensors,
            time_ns,
            read_only(self._position_odom.copy()),
            read_only(rotations.multiply(self._yaw_turn(), attitude)),
            read_only(twist[:, :3].copy()),
            read_only(twist[:, 3:].copy()),
            read_only(variance),
            self._twist_variance,
            is_ground_truth=False,
        )

    def _switch_on(self, rows: NDArray[np.int64], time_ns: int) -> None:  # noqa: ARG002
        """Starts at the present positions of the UAVs."""
        self._yaw_error[rows] = 0.0
        self._flown[rows] = 0.0
        self._position_odom[rows] = self._fleet.state.position_map[self._rows[rows]]
        self._last_position[rows] = self._position_odom[rows]

    def _yaw_turn(self) -> Array:
        return rotations.from_yaw(self._yaw_error)


class GroundTruthBank(Memoryless):
    """Ground truth: exact poses in the map frame and twists in the body frame (FLU)."""

    name = "ground_truth"
    lag_ns = 0

    def __init__(self, group: SensorGroup) -> None:
        super().__init__(group)
        self._taken = in_one_piece(self._rows)
        self._no_variance = read_only(np.zeros((len(self._rows), 6)))

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> OdometrySamples:  # noqa: ARG002
        """Returns the present state of all S UAVs of the bank."""
        twist = _twist_body(fleet, self._rows)
        return OdometrySamples(
            self.sensors,
            time_ns,
            read_only(fleet.state.position_map[self._taken].copy()),
            read_only(fleet.state.attitude[self._taken].copy()),
            read_only(twist[:, :3].copy()),
            read_only(twist[:, 3:].copy()),
            self._no_variance,
            self._no_variance,
            is_ground_truth=True,
        )


def _twist_body(fleet: Fleet, rows: NDArray[np.int64]) -> Array:
    state = fleet.state
    twist = np.empty((len(rows), 6))
    body_twists(rows, state.attitude, state.velocity_map, state.omega_body, twist)
    return twist
