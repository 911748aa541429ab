"""Angles of the sun by position, date and hour."""

from __future__ import annotations

import datetime
import math


def sun_angles(latitude_deg: float, date: datetime.date, hour_of_day: float) -> tuple[float, float]:
    """Returns the elevation above the horizon and the azimuth clockwise from north, deg.

    hour_of_day: local mean solar time, 0 to 24: 12 is noon except for the equation of time, and no
    time zone is needed. Declination and equation of time are Spencer's series (1971, "Fourier
    series representation of the position of the sun"; within 0.05 deg and 35 s); refraction, half a
    degree at the horizon, is left out.
    """
    days = date.timetuple().tm_yday - 1 + hour_of_day / 24.0
    year = 2.0 * math.pi * days / 365.0
    c1, s1, c2, s2 = math.cos(year), math.sin(year), math.cos(2.0 * year), math.sin(2.0 * year)
    c3, s3 = math.cos(3.0 * year), math.sin(3.0 * year)
    declination = (0.006918 - 0.399912 * c1 + 0.070257 * s1 - 0.006758 * c2 + 0.000907 * s2) + (
        -0.002697 * c3 + 0.00148 * s3
    )
    ahead = 0.000075 + 0.001868 * c1 - 0.032077 * s1 - 0.014615 * c2 - 0.040849 * s2
    hour_angle = math.radians(15.0 * (hour_of_day - 12.0)) + ahead
    latitude = math.radians(latitude_deg)
    east = -math.cos(declination) * math.sin(hour_angle)
    north = math.sin(declination) * math.cos(latitude) - math.cos(declination) * math.sin(
        latitude
    ) * math.cos(hour_angle)
    up = math.sin(declination) * math.sin(latitude) + math.cos(declination) * math.cos(
        latitude
    ) * math.cos(hour_angle)
    elevation = math.degrees(math.asin(min(max(up, -1.0), 1.0)))
    return elevation, math.degrees(math.atan2(east, north)) % 360.0
