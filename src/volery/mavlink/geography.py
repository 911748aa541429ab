"""Places on the earth of one vehicle, without arrays: it is asked hundreds of times a second."""

from __future__ import annotations

import math

from volery.core.geodesy import ECCENTRICITY_SQUARED, SEMI_MAJOR_M, LocalFrame, ecef_from_geodetic
from volery.mavlink.vehicle import Vector


class Earth:
    """The map on the earth: latitude and longitude in degrees, altitude in m.

    The same formulas as `core.geodesy` (H. Vermeille, Journal of Geodesy 76, 2002).
    """

    def __init__(self, latitude: float, longitude: float, altitude: float) -> None:
        self._frame = LocalFrame.from_degrees(latitude, longitude, altitude)
        self._columns = self._frame.enu_from_ecef_matrix.T.tolist()
        self._centre = ecef_from_geodetic(self._frame.origin_geodetic).tolist()

    def geodetic(self, place: Vector) -> Vector:
        """Degrees, degrees, m of a place in the map."""
        x, y, z = (
            centre + row[0] * place[0] + row[1] * place[1] + row[2] * place[2]
            for centre, row in zip(self._centre, self._columns, strict=True)
        )
        e2 = ECCENTRICITY_SQUARED
        axis = math.hypot(x, y)
        p = (axis / SEMI_MAJOR_M) ** 2
        q = (1.0 - e2) * (z / SEMI_MAJOR_M) ** 2
        r = (p + q - e2 * e2) / 6.0
        s = e2 * e2 * p * q / (4.0 * r**3)
        t = math.cbrt(1.0 + s + math.sqrt(s * (2.0 + s)))
        u = r * (1.0 + t + 1.0 / t)
        v = math.sqrt(u * u + e2 * e2 * q)
        w = e2 * (u + v - q) / (2.0 * v)
        k = math.sqrt(u + v + w * w) - w
        d = k * axis / (k + e2)
        surface = math.hypot(d, z)
        return (
            math.degrees(2.0 * math.atan2(z, d + surface)),
            math.degrees(math.atan2(y, x)),
            (k + e2 - 1.0) / k * surface,
        )

    def place(self, latitude: float, longitude: float, altitude: float) -> Vector:
        """The place in the map of degrees, degrees, m."""
        geodetic = [math.radians(latitude), math.radians(longitude), altitude]
        x, y, z = self._frame.enu_from_geodetic(geodetic).tolist()
        return x, y, z
