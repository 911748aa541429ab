"""Converts positions of one vehicle to the earth and back, without arrays: hundreds a second."""

from __future__ import annotations

import math

from volery.core.geodesy import LocalFrame, ecef_from_geodetic, geodetic_from_ecef_point
from volery.mavlink.autopilot.vehicle import Vector


class GeoReference:
    """Relates the map to the earth: latitude and longitude in degrees, altitude in m."""

    def __init__(self, latitude: float, longitude: float, altitude: float) -> None:
        self._frame = LocalFrame.from_degrees(latitude, longitude, altitude)
        self._columns = self._frame.enu_from_ecef_matrix.T.tolist()
        self._centre = ecef_from_geodetic(self._frame.origin_geodetic).tolist()

    def geodetic(self, position: Vector) -> Vector:
        """Returns degrees, degrees, m of a position in the map."""
        x, y, z = (
            centre + row[0] * position[0] + row[1] * position[1] + row[2] * position[2]
            for centre, row in zip(self._centre, self._columns, strict=True)
        )
        latitude, longitude, altitude = geodetic_from_ecef_point(x, y, z)
        return math.degrees(latitude), math.degrees(longitude), altitude

    def map_position(self, latitude: float, longitude: float, altitude: float) -> Vector:
        """Returns the position in the map of degrees, degrees, m."""
        geodetic = [math.radians(latitude), math.radians(longitude), altitude]
        x, y, z = self._frame.enu_from_geodetic(geodetic).tolist()
        return x, y, z
