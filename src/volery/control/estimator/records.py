"""Records of the filter: state of one UAV, assumptions, and queued measurements."""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from volery.control.estimator.settings import EstimatorSettings, Mounting
from volery.core import rotations

POSITION, VELOCITY, ROTATION, GYRO_BIAS, ACCEL_BIAS = 0, 3, 6, 9, 12
"""First of three error states each: map, map, rotation vector in the map, body, body ..."""
PRESSURE_OFFSET, HEADING_OFFSET, GNSS_OFFSET = 15, 16, 17
"""... and the slow errors of the aiding sources: m, rad, three m in the map."""
STATES = 20
OFFSETS = STATES - PRESSURE_OFFSET

GNSS, PRESSURE, MAGNETIC, RANGE, POSE, STATED_VELOCITY = range(6)
"""Kinds of measurements; each has up to two parts with a gate each."""
PARTS = 2
QUEUE = 96
"""Maximum number of queued measurements of one UAV."""


class AidingSource(IntEnum):
    """Aiding sources of the filter, each with its own gate."""

    GNSS_POSITION = PARTS * GNSS
    GNSS_VELOCITY = PARTS * GNSS + 1
    PRESSURE_HEIGHT = PARTS * PRESSURE
    MAGNETIC_HEADING = PARTS * MAGNETIC
    RANGE_TO_GROUND = PARTS * RANGE
    POSE_POSITION = PARTS * POSE
    POSE_ATTITUDE = PARTS * POSE + 1
    VELOCITY = PARTS * STATED_VELOCITY


AIDS = PARTS * 6

READING = np.dtype(
    [
        ("stamp_ns", "i8"),
        ("gyro", "f8", 3),
        ("accel", "f8", 3),
        ("gyro_cut", "i8"),
        ("accel_cut", "i8"),
    ],
    align=True,
)
"""An IMU measurement, body axes: rad/s, m/s^2; 1: an axis is at the sensor's full scale."""

MEASUREMENT = np.dtype(
    [("stamp_ns", "i8"), ("kind", "i8"), ("value", "f8", 7), ("variance", "f8", 6)], align=True
)
"""A queued measurement; an infinite variance marks a missing part."""

FLOW = np.dtype(
    [
        ("duration", "f8"),  # s
        ("speed", "f8", 3),  # integral of the specific force, map, m/s
        ("displacement", "f8", 3),  # and of that, m
        ("turn", "f8", (3, 3)),  # integral of the rotation matrix, s
        ("turn_integral", "f8", (3, 3)),  # and of that, s^2
        ("gyro_speed", "f8", (3, 3)),  # velocity by gyro bias, m
        ("gyro_displacement", "f8", (3, 3)),  # position by gyro bias, m s
        ("lost_turn", "f8"),  # variances of what saturated readings left out, rad^2
        ("lost_speed", "f8"),  # m^2/s^2
    ],
    align=True,
)
"""The error transition over an interval of motion, as the integrals of its blocks:

p' = p + T v - displacement x r + gyro_displacement g - turn_integral a
v' = v - speed x r + gyro_speed g - turn a
r' = r - turn g
"""

FILTER = np.dtype(
    [
        # the present, centre of mass
        ("position_map", "f8", 3),
        ("velocity_map", "f8", 3),
        ("attitude", "f8", 4),
        ("omega_body", "f8", 3),
        # the horizon, at the IMU
        ("position", "f8", 3),
        ("velocity", "f8", 3),
        ("rotation", "f8", 4),
        ("gyro_bias", "f8", 3),
        ("accel_bias", "f8", 3),
        ("offset", "f8", OFFSETS),
        ("reading", READING),
        ("flow", FLOW),  # from the covariance's time to the horizon
        ("covariance", "f8", STATES * STATES),
        # bookkeeping
        ("newest_ns", "i8"),
        ("readings", "i8"),  # since the start
        ("first_reading", "i8"),  # of the ring of readings between horizon and present
        ("waiting_readings", "i8"),
        ("first_measurement", "i8"),
        ("waiting_measurements", "i8"),
        ("rejected_since_ns", "i8"),  # fixes, poses; -1: the last one was accepted
        ("restarts", "i8"),
        ("dropped", "i8"),
        ("innovation", "f8", AIDS),  # normalised, squared, the latest
        ("accepted", "i8", AIDS),
        ("rejected", "i8", AIDS),
    ],
    align=True,
)
"""State of one UAV's filter."""

WORK = np.dtype(
    [
        ("H", "f8", (3, STATES)),
        ("residual", "f8", 3),
        ("variance", "f8", 3),
        ("error", "f8", STATES),
        ("keep", "f8", STATES),
        ("product", "f8", STATES),
        ("gain", "f8", STATES),
        ("rest", "f8", STATES),
        ("square", "f8", (3, 3)),
        ("whitened", "f8", 3),
        ("flow", FLOW),
    ],
    align=True,
)
"""Temporary memory; valid within a call only."""

TUNING = np.dtype(
    [
        ("horizon_ns", "i8"),
        ("lateness_ns", "i8"),
        ("restart_ns", "i8"),
        ("pose_restart_ns", "i8"),
        ("gyro_noise", "f8"),  # spectral densities: rad^2/s, m^2/s^3
        ("accel_noise", "f8"),
        ("gyro_range", "f8"),  # full scale of the IMU: rad/s, m/s^2
        ("accel_range", "f8"),
        ("bias_walk", "f8", 2),  # of the biases: rad^2/s^3, m^2/s^5
        ("offset_rate", "f8", OFFSETS),
        ("offset_variance", "f8", OFFSETS),
        ("pressure_walk", "f8"),  # m^2/s
        ("imu_arm", "f8", 3),  # m, body, from the centre of mass
        ("gnss_arm", "f8", 3),  # m, body, from the IMU ...
        ("pressure_arm", "f8", 3),
        ("range_arm", "f8", 3),
        ("imu_attitude", "f8", 4),
        ("magnetic_attitude", "f8", 4),
        ("range_axis", "f8", 3),
        ("range_half_cone", "f8"),
        ("range_largest_tilt", "f8"),
        ("ground_variance", "f8"),
        ("field", "f8", 3),
        ("field_tolerance", "f8"),
        ("gate_1", "f8"),
        ("gate_3", "f8"),
    ],
    align=True,
)
"""Parameters of one UAV's filter."""


def tuning_of(settings: EstimatorSettings, mounting: Mounting) -> NDArray[np.void]:
    """Returns the (1,) `TUNING` record of `settings` and `mounting`."""
    record = np.zeros(1, TUNING)
    row = record[0]
    row["horizon_ns"] = round(settings.horizon_s * 1e9)
    row["lateness_ns"] = round(settings.lateness_s * 1e9)
    row["restart_ns"] = round(settings.restart_after_s * 1e9)
    row["pose_restart_ns"] = round(settings.pose_restart_after_s * 1e9)
    row["gyro_noise"] = settings.gyro_noise_density_rad_s_sqrt_hz**2
    row["accel_noise"] = settings.accel_noise_density_m_s2_sqrt_hz**2
    row["gyro_range"] = settings.gyro_range_rad_s or math.inf
    row["accel_range"] = settings.accel_range_m_s2 or math.inf
    row["bias_walk"] = np.square(
        [settings.gyro_random_walk_rad_s2_sqrt_hz, settings.accel_random_walk_m_s3_sqrt_hz]
    )
    row["offset_rate"] = [
        0.0,
        1.0 / settings.heading_offset_correlation_s,
        *(3 * [1.0 / settings.gnss_offset_correlation_s]),
    ]
    row["offset_variance"] = np.square(
        [0.0, settings.heading_offset_sigma_rad, *settings.gnss_offset_sigma_m]
    )
    row["pressure_walk"] = settings.pressure_drift_m_sqrt_s**2
    imu = np.array(mounting.imu_position_body)
    row["imu_arm"] = imu
    row["gnss_arm"] = np.array(mounting.gnss_position_body) - imu
    row["pressure_arm"] = np.array(mounting.barometer_position_body) - imu
    row["range_arm"] = np.array(mounting.range_position_body) - imu
    row["imu_attitude"] = rotations.normalize(mounting.imu_attitude_body)
    row["magnetic_attitude"] = rotations.normalize(mounting.magnetometer_attitude_body)
    row["range_axis"] = np.array(mounting.range_axis_body) / np.linalg.norm(
        mounting.range_axis_body
    )
    row["range_half_cone"] = settings.range_half_cone_rad
    row["range_largest_tilt"] = settings.range_largest_tilt_rad
    row["ground_variance"] = settings.ground_sigma_m**2
    row["field"] = settings.magnetic_field_map
    row["field_tolerance"] = settings.magnetic_strength_tolerance
    row["gate_1"], row["gate_3"] = settings.gate_1, settings.gate_3
    return record
