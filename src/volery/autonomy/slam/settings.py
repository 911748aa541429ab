"""What the tracker knows of its sensors and of itself."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ImuNoise:
    """Noise of the IMU; the defaults are the ADIS16448's as RotorS and OpenUAV simulate it."""

    gyro_rad_s_sqrt_hz: float = 3.394e-4
    gyro_walk_rad_s2_sqrt_hz: float = 3.879e-5
    gyro_turn_on_rad_s: float = 0.00873
    accel_m_s2_sqrt_hz: float = 0.004
    accel_walk_m_s3_sqrt_hz: float = 0.006
    accel_turn_on_m_s2: float = 0.196


@dataclass(frozen=True)
class ScanMatching:
    """How returns are compared with the map (modelling choices, tried on recorded flights)."""

    reach_m: float = 30.0
    """The data sheet of the UTM-30LX guarantees no more."""
    nearest_m: float = 0.45
    """Nearer returns are the vehicle's own, or noise."""
    rounds: int = 3
    """Gauss-Newton rounds of an update."""
    upright_sigma_m: float = 0.05
    """Of a return about the upright that it met: range, angle, bark."""
    ground_sigma_m: float = 0.05
    gravity_walk_rad_sqrt_s: float = 2e-4
    """How the frame of the local map turns against gravity as the map grows."""
    trust: float = 0.05
    """Share of the returns' information that is believed: their errors have the map's in common."""
    insert_m: float = 0.25
    insert_rad: float = 0.07
    insert_s: float = 1.0
    """Motion, or time, after which a scan enters the map."""


GRAVITY_M_S2 = 9.80665
