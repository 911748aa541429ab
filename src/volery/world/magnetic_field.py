"""The earth's magnetic field: the International Geomagnetic Reference Field, 14th generation.

The potential is a series of spherical harmonics (Alken et al., International Geomagnetic Reference
Field: the thirteenth generation, Earth, Planets and Space 73, 2021, eq. 1); the field is its
negative gradient. `data/igrf14_2025.csv` holds the coefficients. The field of iron, power lines and
rock is not modelled.
"""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np

from volery.core.arrays import Array
from volery.core.geodesy import LocalFrame, ecef_from_geodetic

EPOCH_YEAR = 2025.0
_FILE = Path(__file__).parent / "data" / "igrf14_2025.csv"
_REFERENCE_RADIUS_M = 6_371_200.0
"""Radius that the coefficients refer to (IGRF)."""
_T_PER_NT = 1e-9


def field_enu(frame: LocalFrame, year: float = EPOCH_YEAR) -> Array:
    """Returns the field (3,) at a frame's origin, T, east-north-up.

    `year` is a decimal year within five years of the epoch, 2025.
    """
    ecef = ecef_from_geodetic(frame.origin_geodetic)
    radius = float(np.linalg.norm(ecef))
    # East is undefined at the poles; a millionth of a radius from them it is not.
    from_axis = max(math.hypot(ecef[0], ecef[1]), 1e-6 * radius)
    cosine, sine = ecef[2] / radius, from_axis / radius
    up, south, east = _spherical_field(radius, cosine, sine, frame.longitude_rad, year)
    # From the geocentric vertical to the ellipsoid's: a turn about the east axis.
    turn = frame.latitude_rad - math.atan2(ecef[2], from_axis)
    north = -south
    return np.array(
        [
            east,
            north * math.cos(turn) - up * math.sin(turn),
            north * math.sin(turn) + up * math.cos(turn),
        ]
    )


def field_of_angles(declination_rad: float, inclination_rad: float, strength_t: float) -> Array:
    """Returns the field (3,), T, east-north-up.

    Declination is east of north, inclination below the horizon.
    """
    level = strength_t * math.cos(inclination_rad)
    return np.array(
        [
            level * math.sin(declination_rad),
            level * math.cos(declination_rad),
            -strength_t * math.sin(inclination_rad),
        ]
    )


def angles_of_field(field: Array) -> tuple[float, float, float]:
    """Returns declination rad, inclination rad and strength T of an east-north-up field (3,)."""
    east, north, up = (float(component) for component in field)
    level = math.hypot(east, north)
    return math.atan2(east, north), math.atan2(-up, level), math.hypot(level, up)


@cache
def _coefficients() -> Array:
    """Returns the coefficients (rows, 6): n, m, g, h and their change per year."""
    return np.loadtxt(_FILE, delimiter=",", skiprows=3)


def _spherical_field(
    radius: float, cosine: float, sine: float, longitude: float, year: float
) -> tuple[float, float, float]:
    """Returns the field upward, southward, eastward, T, at a radius, colatitude and longitude."""
    table = _coefficients()
    values, slopes = _legendre(int(table[-1, 0]), cosine, sine)
    up = south = east = 0.0
    for n_, m_, g0, h0, g_dot, h_dot in table.tolist():
        n, m = int(n_), int(m_)
        g = g0 + (year - EPOCH_YEAR) * g_dot
        h = h0 + (year - EPOCH_YEAR) * h_dot
        scale = (_REFERENCE_RADIUS_M / radius) ** (n + 2) * _T_PER_NT
        wave = g * math.cos(m * longitude) + h * math.sin(m * longitude)
        along = m * (h * math.cos(m * longitude) - g * math.sin(m * longitude))
        up += scale * (n + 1) * wave * values[n, m]
        south -= scale * wave * slopes[n, m]
        east -= scale * along * values[n, m] / sine
    return up, south, east


def _legendre(degree: int, cosine: float, sine: float) -> tuple[Array, Array]:
    """Returns Schmidt semi-normalised Legendre functions and derivatives by colatitude, [n, m]."""
    p = np.zeros((degree + 1, degree + 1))
    d = np.zeros_like(p)
    p[0, 0] = 1.0
    for n in range(1, degree + 1):
        grow = 1.0 if n == 1 else math.sqrt(1.0 - 0.5 / n)
        p[n, n] = grow * sine * p[n - 1, n - 1]
        d[n, n] = grow * (cosine * p[n - 1, n - 1] + sine * d[n - 1, n - 1])
        for m in range(n):
            root = math.sqrt(n * n - m * m)
            before = math.sqrt((n - 1) ** 2 - m * m) if m < n - 1 else 0.0
            p_before = p[n - 2, m] if m < n - 1 else 0.0
            d_before = d[n - 2, m] if m < n - 1 else 0.0
            p[n, m] = ((2 * n - 1) * cosine * p[n - 1, m] - before * p_before) / root
            slope = (2 * n - 1) * (cosine * d[n - 1, m] - sine * p[n - 1, m])
            d[n, m] = (slope - before * d_before) / root
    return p, d
