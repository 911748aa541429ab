"""Estimation errors, and covariances in the form of ROS messages."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from volery.control.estimator.records import GYRO_BIAS, POSITION, ROTATION, VELOCITY
from volery.core import rotations
from volery.core.arrays import Array

_OF_POSE = np.r_[POSITION : POSITION + 3, ROTATION : ROTATION + 3]


class MotionState(Protocol):
    """Motion of N UAVs: an `Estimate`, or a fleet's true state."""

    @property
    def position_map(self) -> Array:
        """(N, 3) positions, m, map frame."""

    @property
    def velocity_map(self) -> Array:
        """(N, 3) velocities, m/s, map frame."""

    @property
    def attitude(self) -> Array:
        """(N, 4) attitudes x y z w, map from body."""

    @property
    def omega_body(self) -> Array:
        """(N, 3) body rates, rad/s, FLU."""


class EstimationError(NamedTuple):
    """Error of an estimate; it changes slowly and does not turn with the vehicle."""

    position_map: Array
    """(N, 3) m: estimate = truth + error."""
    velocity_map: Array
    """(N, 3) m/s: estimate = truth + error."""
    rotation_map: Array
    """(N, 4): estimated attitude = error * true attitude."""
    omega_body: Array
    """(N, 3) rad/s: estimate = truth + error."""


def estimation_error(estimate: MotionState, truth: MotionState) -> EstimationError:
    """Returns the errors of N estimates at one time."""
    rotation = rotations.multiply(estimate.attitude, rotations.conjugate(truth.attitude))
    return EstimationError(
        estimate.position_map - truth.position_map,
        estimate.velocity_map - truth.velocity_map,
        np.where(rotation[..., 3:] < 0.0, -rotation, rotation),
        estimate.omega_body - truth.omega_body,
    )


def pose_covariance(covariance: Array) -> Array:
    """Returns (S, 6, 6) as in nav_msgs/Odometry: x, y, z, m^2, rotations about the map's axes.

    covariance: (S, STATES, STATES), of `Estimator.covariance`.
    """
    return np.asarray(covariance[:, _OF_POSE[:, None], _OF_POSE])


def twist_covariance(
    covariance: Array, velocity_map: Array, attitude: Array, gyro_variance: Array | float
) -> Array:
    """Returns (S, 6, 6) of the twist in the body frame (FLU): velocity, then rates.

    covariance: (S, STATES, STATES); velocity_map (S, 3) m/s; attitude (S, 4); gyro_variance: () or
    (S,), rad^2/s^2, of the noise of one measurement.
    """
    turn = np.swapaxes(rotations.matrix(attitude), 1, 2)
    jacobian = np.zeros((len(covariance), 6, covariance.shape[1]))
    jacobian[:, :3, VELOCITY : VELOCITY + 3] = turn
    # an attitude error turns the axes of a correct velocity
    jacobian[:, :3, ROTATION : ROTATION + 3] = turn @ _skew(velocity_map)
    jacobian[:, 3:, GYRO_BIAS : GYRO_BIAS + 3] = -np.eye(3)
    out = jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)
    out[:, range(3, 6), range(3, 6)] += np.reshape(gyro_variance, (-1, 1))
    return np.asarray(out)


def _skew(v: Array) -> Array:
    """Returns (S, 3, 3), with skew(v) u = v x u."""
    x, y, z = v.T
    o = np.zeros_like(x)
    return np.array([[o, -z, y], [z, o, -x], [-y, x, o]]).transpose(2, 0, 1)
