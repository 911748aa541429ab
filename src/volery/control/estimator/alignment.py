"""Attitude of a vehicle at rest, and the covariance at the start."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from volery.control.estimator.records import (
    ACCEL_BIAS,
    GNSS_OFFSET,
    GYRO_BIAS,
    HEADING_OFFSET,
    POSITION,
    PRESSURE_OFFSET,
    ROTATION,
    STATES,
    VELOCITY,
)
from volery.control.estimator.settings import EstimatorSettings, StartSigmas
from volery.core import rotations
from volery.core.arrays import Array
from volery.vehicle.airframe import GRAVITY


def align_at_rest(
    specific_force_body: ArrayLike, magnetic_body: ArrayLike, magnetic_field_map: ArrayLike
) -> Array:
    """Returns the attitude (..., 4), map from body, of vehicles at rest.

    The mean specific force (..., 3) points up, which gives the tilt; the mean magnetic field (...,
    3), levelled, points along the horizontal part of `magnetic_field_map` (3,), which gives the
    heading. Body axes: FLU.
    """
    up = np.asarray(specific_force_body, dtype=np.float64)
    up = up / np.linalg.norm(up, axis=-1, keepdims=True)
    roll = np.arctan2(up[..., 1], up[..., 2])
    pitch = np.arctan2(-up[..., 0], np.hypot(up[..., 1], up[..., 2]))
    level = rotations.from_rpy(roll, pitch, 0.0)
    seen = rotations.rotate(level, magnetic_body)
    known = np.asarray(magnetic_field_map, dtype=np.float64)
    yaw = np.arctan2(known[1], known[0]) - np.arctan2(seen[..., 1], seen[..., 0])
    return rotations.multiply(rotations.from_yaw(yaw), level)


def start_covariance(settings: EstimatorSettings, start: StartSigmas, attitude: Array) -> Array:
    """Returns the covariance (STATES, STATES) of the error states at the start; attitude: (4,)."""
    sigma = np.zeros(STATES)
    sigma[POSITION : POSITION + 3] = start.position_m
    sigma[VELOCITY : VELOCITY + 3] = start.velocity_m_s
    sigma[ROTATION : ROTATION + 2] = start.tilt_rad
    sigma[ROTATION + 2] = start.heading_rad
    sigma[GYRO_BIAS : GYRO_BIAS + 3] = settings.gyro_turn_on_bias_rad_s
    sigma[ACCEL_BIAS : ACCEL_BIAS + 3] = settings.accel_turn_on_bias_m_s2
    sigma[PRESSURE_OFFSET] = settings.pressure_offset_sigma_m
    sigma[HEADING_OFFSET] = settings.heading_offset_sigma_rad
    sigma[GNSS_OFFSET : GNSS_OFFSET + 3] = settings.gnss_offset_sigma_m
    mixing = np.eye(STATES)
    if start.aligned:
        mixing = _alignment_errors(settings, attitude) @ mixing
    spread = mixing * sigma
    return np.asarray(spread @ spread.T)


def _alignment_errors(settings: EstimatorSettings, attitude: Array) -> Array:
    """Returns the effect (STATES, STATES) of sensor errors on `align_at_rest`.

    A bias b of the accelerometer tilts the vertical by R b / g; a tilt turns the heading by the
    field's dip, as in the measurement of the heading; the heading's error is its offset.
    """
    turn = rotations.matrix(attitude)
    mixing = np.eye(STATES)
    mixing[ROTATION, ACCEL_BIAS : ACCEL_BIAS + 3] = -turn[1] / GRAVITY
    mixing[ROTATION + 1, ACCEL_BIAS : ACCEL_BIAS + 3] = turn[0] / GRAVITY
    east, north, up = settings.magnetic_field_map
    dip = up / (east * east + north * north)
    mixing[ROTATION + 2] += dip * (east * mixing[ROTATION] + north * mixing[ROTATION + 1])
    mixing[ROTATION + 2, HEADING_OFFSET] += 1.0
    return mixing
