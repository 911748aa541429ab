"""Converts between WGS-84 geodetic coordinates, ECEF and a local tangent plane (ENU).

Geodetic arrays are (..., 3): latitude rad, longitude rad, height above the ellipsoid m. ECEF and
ENU arrays are (..., 3) m. The geoid is not modelled: heights above the ellipsoid and above sea
level are equal here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from volery.core.arrays import Array

SEMI_MAJOR_M = 6_378_137.0
"""WGS-84 defining parameter."""
FLATTENING = 1.0 / 298.257223563
"""WGS-84 defining parameter."""
ECCENTRICITY_SQUARED = FLATTENING * (2.0 - FLATTENING)


def ecef_from_geodetic(geodetic: ArrayLike) -> Array:
    """Returns the ECEF positions of geodetic coordinates."""
    latitude, longitude, height = _components(geodetic)
    sine = np.sin(latitude)
    normal = SEMI_MAJOR_M / np.sqrt(1.0 - ECCENTRICITY_SQUARED * sine * sine)
    from_axis = (normal + height) * np.cos(latitude)
    return np.stack(
        [
            from_axis * np.cos(longitude),
            from_axis * np.sin(longitude),
            (normal * (1.0 - ECCENTRICITY_SQUARED) + height) * sine,
        ],
        axis=-1,
    )


def geodetic_from_ecef(ecef: ArrayLike) -> Array:
    """Returns the geodetic coordinates of ECEF positions beyond 43 km from the earth's centre."""
    return np.stack(_geodetic(np, *_components(ecef)), axis=-1)


def geodetic_from_ecef_point(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Converts one point without arrays, which take about ten times as long."""
    latitude, longitude, height = _geodetic(math, x, y, z)
    return latitude, longitude, height


def _geodetic(library: ModuleType, x: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
    """Returns latitude, longitude, height, computed by `math` or `numpy`.

    Closed form, without iterations: H. Vermeille, Direct transformation from geocentric coordinates
    to geodetic coordinates, Journal of Geodesy 76 (2002).
    """
    e2 = ECCENTRICITY_SQUARED
    from_axis = library.hypot(x, y)
    p = (from_axis / SEMI_MAJOR_M) ** 2
    q = (1.0 - e2) * (z / SEMI_MAJOR_M) ** 2
    r = (p + q - e2 * e2) / 6.0
    s = e2 * e2 * p * q / (4.0 * r**3)
    t = library.cbrt(1.0 + s + library.sqrt(s * (2.0 + s)))
    u = r * (1.0 + t + 1.0 / t)
    v = library.sqrt(u * u + e2 * e2 * q)
    w = e2 * (u + v - q) / (2.0 * v)
    k = library.sqrt(u + v + w * w) - w
    d = k * from_axis / (k + e2)
    to_surface = library.hypot(d, z)
    return (
        2.0 * library.atan2(z, d + to_surface),
        library.atan2(y, x),
        (k + e2 - 1.0) / k * to_surface,
    )


@dataclass(frozen=True)
class LocalFrame:
    """East-north-up axes tangent to the ellipsoid at an origin: the map."""

    latitude_rad: float
    longitude_rad: float
    altitude_m: float

    @classmethod
    def from_degrees(cls, latitude: float, longitude: float, altitude_m: float) -> LocalFrame:
        """Returns the frame at a latitude and longitude in degrees, altitude in m."""
        return cls(float(np.radians(latitude)), float(np.radians(longitude)), altitude_m)

    @property
    def origin_geodetic(self) -> Array:
        """(3,) geodetic coordinates of the origin."""
        return np.array([self.latitude_rad, self.longitude_rad, self.altitude_m])

    @property
    def enu_from_ecef_matrix(self) -> Array:
        """(3, 3) rotation; its rows are east, north and up in ECEF."""
        sa, ca = np.sin(self.latitude_rad), np.cos(self.latitude_rad)
        so, co = np.sin(self.longitude_rad), np.cos(self.longitude_rad)
        return np.array([[-so, co, 0.0], [-sa * co, -sa * so, ca], [ca * co, ca * so, sa]])

    def ecef_from_enu(self, enu: ArrayLike) -> Array:
        """Returns the ECEF positions of ENU positions."""
        turned = np.asarray(enu, dtype=np.float64) @ self.enu_from_ecef_matrix
        return np.asarray(turned + ecef_from_geodetic(self.origin_geodetic))

    def enu_from_ecef(self, ecef: ArrayLike) -> Array:
        """Returns the ENU positions of ECEF positions."""
        offset = np.asarray(ecef, dtype=np.float64) - ecef_from_geodetic(self.origin_geodetic)
        return np.asarray(offset @ self.enu_from_ecef_matrix.T)

    def geodetic_from_enu(self, enu: ArrayLike) -> Array:
        """Returns the geodetic coordinates of ENU positions."""
        return geodetic_from_ecef(self.ecef_from_enu(enu))

    def enu_from_geodetic(self, geodetic: ArrayLike) -> Array:
        """Returns the ENU positions of geodetic coordinates."""
        return self.enu_from_ecef(ecef_from_geodetic(geodetic))


def _components(array: ArrayLike) -> tuple[Array, Array, Array]:
    array = np.asarray(array, dtype=np.float64)
    return array[..., 0], array[..., 1], array[..., 2]
