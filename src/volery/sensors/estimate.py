"""Estimates of the on-board estimators, as odometry: the source of `/uavN/odom`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volery.control.estimator.errors import pose_covariance, twist_covariance
from volery.control.estimator.estimator import Estimator
from volery.control.fleet import Fleet
from volery.core import rotations
from volery.core.arrays import Array, read_only
from volery.core.rows import in_one_piece
from volery.sensors.bank import Memoryless, SensorGroup
from volery.sensors.samples import OdometrySamples


class EstimateBank(Memoryless):
    """The estimates of all UAVs of one rate and phase.

    `rows` (S,) are the UAVs' rows in the estimator, `gyro_variance` (S,) rad^2/s^2 the variance of
    one gyroscope measurement, which the estimated rates contain.
    """

    name = "estimate"
    lag_ns = 0

    def __init__(
        self,
        group: SensorGroup,
        estimator: Estimator,
        rows: NDArray[np.int64],
        gyro_variance: Array,
    ) -> None:
        super().__init__(group)
        self._estimator = estimator
        self._rows = rows
        self._taken = in_one_piece(rows)
        self._gyro_variance = gyro_variance

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> OdometrySamples:  # noqa: ARG002
        """Returns the present estimates: poses in the map frame, twists in the body frame (FLU)."""
        state, rows = self._estimator.state, self._taken
        velocity, attitude = state.velocity_map[rows], state.attitude[rows].copy()
        covariance = self._estimator.covariance(self._rows)
        twist = twist_covariance(covariance, velocity, attitude, self._gyro_variance)
        return OdometrySamples(
            self.sensors,
            time_ns,
            read_only(state.position_map[rows].copy()),
            read_only(attitude),
            read_only(rotations.rotate(rotations.conjugate(attitude), velocity)),
            read_only(state.omega_body[rows].copy()),
            read_only(np.diagonal(pose_covariance(covariance), axis1=1, axis2=2).copy()),
            read_only(np.diagonal(twist, axis1=1, axis2=2).copy()),
            is_ground_truth=False,
        )
