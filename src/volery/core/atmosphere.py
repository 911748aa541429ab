"""Implements the International Standard Atmosphere (ISO 2533) up to the tropopause at 11 km.

Altitudes are treated as geopotential, as autopilots do; at 1 km the difference is 0.16 m.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from volery.core.arrays import Array

SEA_LEVEL_TEMPERATURE_K = 288.15
SEA_LEVEL_PRESSURE_PA = 101_325.0
LAPSE_RATE_K_M = 0.0065
GAS_CONSTANT_AIR = 287.05287
"""J/(kg K), ISO 2533."""
GRAVITY = 9.80665
PRESSURE_EXPONENT = GRAVITY / (LAPSE_RATE_K_M * GAS_CONSTANT_AIR)
"""5.25588; PX4's simulator rounds it to 5.256."""


def temperature(altitude_m: ArrayLike) -> Array:
    """Returns the temperature, K, at altitudes (...) above sea level, m."""
    return np.asarray(SEA_LEVEL_TEMPERATURE_K - LAPSE_RATE_K_M * np.asarray(altitude_m, float))


def pressure(altitude_m: ArrayLike) -> Array:
    """Returns the pressure, Pa, at altitudes (...) above sea level, m."""
    ratio = temperature(altitude_m) / SEA_LEVEL_TEMPERATURE_K
    return np.asarray(SEA_LEVEL_PRESSURE_PA * ratio**PRESSURE_EXPONENT)


def altitude(pressure_pa: ArrayLike) -> Array:
    """Returns the altitude above sea level, m, of pressures (...), Pa."""
    ratio = np.asarray(pressure_pa, float) / SEA_LEVEL_PRESSURE_PA
    drop = 1.0 - ratio ** (1.0 / PRESSURE_EXPONENT)
    return np.asarray(SEA_LEVEL_TEMPERATURE_K / LAPSE_RATE_K_M * drop)
