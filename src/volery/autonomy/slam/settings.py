"""Parameters of the tracker: sensor noise and scan matching."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ImuNoise:
    """Noise of the IMU; the defaults are those of the ADIS16448 in RotorS and OpenUAV."""

    gyro_rad_s_sqrt_hz: float = 3.394e-4
    gyro_walk_rad_s2_sqrt_hz: float = 3.879e-5
    gyro_turn_on_rad_s: float = 0.00873
    accel_m_s2_sqrt_hz: float = 0.004
    accel_walk_m_s3_sqrt_hz: float = 0.006
    accel_turn_on_m_s2: float = 0.196


@dataclass(frozen=True)
class ScanMatching:
    """Comparison of returns with the map (modelling choices, tuned on recorded flights)."""

    max_range_m: float = 30.0
    """Max range, as guaranteed by the data sheet of the UTM-30LX."""
    nearest_m: float = 0.45
    """Min range; nearer returns are from the vehicle itself, or noise."""
    rounds: int = 3
    """Gauss-Newton rounds of an update."""
    upright_sigma_m: float = 0.05
    """Standard deviation of a return about its upright: range, angle, bark."""
    ground_sigma_m: float = 0.05
    gravity_walk_rad_sqrt_s: float = 2e-4
    """Random walk of the local map's frame against gravity as the map grows."""
    trust: float = 0.05
    """Fraction of the returns' information that is used: their errors are correlated with the
    map's.
    """
    insert_m: float = 0.25
    insert_rad: float = 0.07
    insert_s: float = 1.0
    """Motion, or time, after which a scan is inserted into the map."""


GRAVITY_M_S2 = 9.80665
