"""Settings of the estimator: sensor noise, mounting, initial uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, Field, NonNegativeFloat, PositiveFloat

from volery.scenario.base import Bounded

Vector = tuple[float, float, float]
NonNegativeVector = tuple[NonNegativeFloat, NonNegativeFloat, NonNegativeFloat]
Quaternion = tuple[float, float, float, float]
_MIN_DENSITY = 1e-9
Density = Annotated[NonNegativeFloat, AfterValidator(lambda value: max(value, _MIN_DENSITY))]
"""Density of white noise; zero becomes a small value, so that the filter is regular."""


class EstimatorSettings(Bounded):
    """Noise models and limits of one UAV's filter.

    The keys of the IMU are those of an IMU's data file, so that a sensor's own numbers can be
    passed on; the defaults are the ADIS16448's as RotorS simulates it. The filter's biases walk and
    do not decay, as PX4's: the larger part of a bias, that of the turn-on, is constant.
    """

    gyro_noise_density_rad_s_sqrt_hz: Density = 3.394e-4
    gyro_random_walk_rad_s2_sqrt_hz: NonNegativeFloat = 3.879e-5
    gyro_turn_on_bias_rad_s: NonNegativeFloat = 0.00873
    accel_noise_density_m_s2_sqrt_hz: Density = 0.004
    accel_random_walk_m_s3_sqrt_hz: NonNegativeFloat = 0.006
    accel_turn_on_bias_m_s2: NonNegativeFloat = 0.196
    gyro_range_rad_s: PositiveFloat | None = None
    """Full scale of the gyroscope; None: unlimited. What a reading at full scale leaves out is
    taken to be as large as the full scale itself (modelling choice)."""
    accel_range_m_s2: PositiveFloat | None = None
    """The same for the accelerometer."""
    imu_rate_hz: PositiveFloat = 200.0
    """Sizes the buffer; a higher actual rate shortens the horizon."""

    horizon_s: NonNegativeFloat = 0.13
    """Delay of the fusion horizon; no sensor's delay should be longer. Default: the 120 ms of PX4's
    simulated GNSS receiver and two IMU periods."""
    lateness_s: NonNegativeFloat = 0.02
    """Measurements older than the horizon by more than this are dropped (modelling choice)."""

    gnss_offset_sigma_m: NonNegativeVector = (0.5, 0.5, 0.8)
    """East, north, up: slow part of a receiver's position error, which its stated variances do not
    include as such (modelling choice, within the 1 m that PX4's simulated receiver states)."""
    gnss_offset_correlation_s: PositiveFloat = 60.0
    """Correlation time of that part (PX4's simulated receiver)."""
    pressure_offset_sigma_m: NonNegativeFloat = 20.0
    """Datum of the pressure height at the start; 20 m is 2.4 hPa of weather (modelling choice)."""
    pressure_drift_m_sqrt_s: NonNegativeFloat = 0.05
    """Random walk of that datum: 3 m in an hour of changing weather (modelling choice)."""
    magnetic_field_map: Vector = (1.13e-6, 2.161e-5, -4.302e-5)
    """East, north, up; T, or any other unit that the magnetometer reports. Default: 48 uT, inclined
    by 63.3 deg and declined by 3 deg, as at the origin of PX4's simulated world."""
    magnetic_strength_tolerance: PositiveFloat = 0.3
    """A field that deviates by more than this fraction is a disturbance (modelling choice)."""
    heading_offset_sigma_rad: NonNegativeFloat = 0.02
    """Slow heading error of the magnetometer: hard iron, declination (modelling choice)."""
    heading_offset_correlation_s: PositiveFloat = 600.0
    """Correlation time of PX4's simulated magnetometer."""
    range_half_cone_rad: NonNegativeFloat = math.radians(12.0)
    """Tilt up to which a sonar measures the ground straight below."""
    range_largest_tilt_rad: Annotated[float, Field(gt=0.0, lt=1.5)] = math.radians(25.0)
    """Maximum tilt at which ranges are used (modelling choice)."""
    ground_sigma_m: NonNegativeFloat = 0.05
    """Unevenness of flat ground (modelling choice)."""

    gate_1: PositiveFloat = 25.0
    """Maximum normalised squared innovation of one number: five sigma, as PX4 gates."""
    gate_3: PositiveFloat = 32.0
    """Maximum of three numbers, with about the same probability of a false alarm."""
    restart_after_s: PositiveFloat = 7.0
    """After rejecting all GNSS positions for this time the filter restarts position and velocity
    from a fix with both (PX4's EKF2 resets after 7 s)."""
    pose_restart_after_s: PositiveFloat = 1.0
    """The same for poses, after a SLAM has relocalized. The time is short, because poses that pass
    the gate later, as uncertainty grows, would appear as a drift in velocity."""


@dataclass(frozen=True)
class Mounting:
    """Mounting of one UAV's sensors: m from the centre of mass, and orientation; FLU."""

    imu_position_body: Vector = (0.0, 0.0, 0.0)
    imu_attitude_body: Quaternion = (0.0, 0.0, 0.0, 1.0)
    gnss_position_body: Vector = (0.0, 0.0, 0.0)
    barometer_position_body: Vector = (0.0, 0.0, 0.0)
    magnetometer_attitude_body: Quaternion = (0.0, 0.0, 0.0, 1.0)
    range_position_body: Vector = (0.0, 0.0, 0.0)
    range_axis_body: Vector = (0.0, 0.0, -1.0)
    """Unit vector of the range finder's axis."""


@dataclass(frozen=True)
class StartSigmas:
    """Standard deviations of the initial state (modelling choices).

    With `aligned` the attitude comes from `align_at_rest`: its errors then follow from the errors
    of accelerometer and magnetometer; `tilt_rad` and `heading_rad` are the contribution of averaged
    noise.
    """

    position_m: Vector = (0.5, 0.5, 0.5)
    velocity_m_s: Vector = (0.1, 0.1, 0.1)
    tilt_rad: float = 0.02
    heading_rad: float = 0.05
    aligned: bool = False


AT_REST = StartSigmas(
    velocity_m_s=(0.01, 0.01, 0.01), tilt_rad=2e-3, heading_rad=5e-3, aligned=True
)
"""On the ground, attitude from `align_at_rest` over about a second. The tilt covers averaged noise
and an effect beyond the filter's first order: heading error times accelerometer bias."""
