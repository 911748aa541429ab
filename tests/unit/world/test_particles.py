"""Extinction by rain, snow, fog and dust against published laws and integrals; the sun."""

import datetime
import math

import numpy as np
import pytest
from scipy import integrate

from volery.core.errors import CommandError
from volery.world.weather import CLEAR_AIR, Particles
from volery.world.weather.particles import (
    drop_speed,
    dust_extinction,
    extinction,
    fog_extinction,
    number_per_mm,
    rain_extinction,
    rain_slope,
    snow_extinction,
)
from volery.world.weather.sun import sun_angles

DECIBEL_PER_KM = 1e4 / math.log(10.0)


@pytest.mark.parametrize("rate", [0.5, 5.0, 50.0])
def test_rain_is_the_sum_over_its_drops_and_the_law_of_the_itu(rate):
    slope = 4.1 * rate**-0.21

    def taken(diameter):  # mm^2/m^3 a mm: twice the cross-section of each drop
        return 2.0 * math.pi / 4.0 * diameter**2 * 8000.0 * math.exp(-slope * diameter)

    whole = 1e-6 * integrate.quad(taken, 0.0, 50.0)[0]
    assert rain_extinction(rate) == pytest.approx(whole, rel=1e-6)
    assert rain_extinction(rate) * DECIBEL_PER_KM == pytest.approx(1.58 * rate**0.63, rel=0.005)
    assert number_per_mm(rain_extinction(rate), rain_slope(rate)) == pytest.approx(8000.0)


def test_snow_is_the_law_of_the_itu_for_dry_snow():
    assert snow_extinction(1.0, 905.0) * DECIBEL_PER_KM == pytest.approx(5.5449, rel=1e-4)
    ratio = snow_extinction(4.0, 905.0) / snow_extinction(2.0, 905.0)
    assert ratio == pytest.approx(2.0**1.38)


def test_contrast_is_a_twentieth_at_the_meteorological_optical_range():
    for visibility in (20.0, 800.0, 30_000.0):
        assert math.exp(-fog_extinction(visibility) * visibility) == pytest.approx(0.05)
        assert math.exp(-dust_extinction(visibility) * visibility) == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("two_percent_km", "exponent"), [(0.4, 0.0), (0.8, 0.3), (3.0, 0.82), (20.0, 1.3), (60.0, 1.6)]
)
def test_fog_at_905_nm_by_kim(two_percent_km, exponent):
    """Kim's visibility is that of a contrast of 2 %."""
    visibility = 1e3 * two_percent_km * math.log(20.0) / math.log(50.0)
    ratio = fog_extinction(visibility, 905.0) / fog_extinction(visibility)
    assert ratio == pytest.approx((905.0 / 550.0) ** -exponent, rel=1e-9)


def test_particles_add_up():
    parts = [Particles(rain_mm_h=8.0), Particles(snow_mm_h=1.0), Particles(fog_visibility_m=300.0)]
    mixed = Particles(rain_mm_h=8.0, snow_mm_h=1.0, fog_visibility_m=300.0)
    assert extinction(mixed, 905.0) == pytest.approx(sum(extinction(p, 905.0) for p in parts))
    assert extinction(CLEAR_AIR, 905.0) == 0.0
    assert CLEAR_AIR.visibility_m == math.inf
    assert Particles(dust_visibility_m=70.0).visibility_m == pytest.approx(70.0)


@pytest.mark.parametrize(
    "values",
    [
        {"rain_mm_h": -1.0},
        {"rain_mm_h": math.nan},
        {"snow_mm_h": 21.0},
        {"fog_visibility_m": 0.0},
        {"dust_visibility_m": math.nan},
    ],
)
def test_particles_out_of_range_are_refused(values):
    with pytest.raises(CommandError, match=f"{next(iter(values))}.*is allowed"):
        Particles(**values)


def test_drops_fall_as_gunn_and_kinzer_measured():
    for diameter, speed in ((1.0, 4.03), (2.0, 6.49), (4.0, 8.83)):  # 1949
        assert drop_speed(diameter) == pytest.approx(speed, abs=0.15)


def almanac(latitude_deg, date, hour):
    """The sun by the Astronomical Almanac's approximation (Michalsky 1988), 0.01 deg.

    At longitude 0, where local mean solar time is universal time.
    """
    n = date.toordinal() - datetime.date(2000, 1, 1).toordinal() - 0.5 + hour / 24.0
    mean = math.radians(357.528 + 0.9856003 * n)
    longitude = 280.460 + 0.9856474 * n + 1.915 * math.sin(mean) + 0.020 * math.sin(2.0 * mean)
    ecliptic, tilt = math.radians(longitude), math.radians(23.439 - 4e-7 * n)
    ascension = math.atan2(math.cos(tilt) * math.sin(ecliptic), math.cos(ecliptic))
    declination = math.asin(math.sin(tilt) * math.sin(ecliptic))
    sidereal = math.radians((6.697375 + 0.0657098242 * n + hour) * 15.0)
    latitude, h = math.radians(latitude_deg), sidereal - ascension
    up = math.sin(declination) * math.sin(latitude)
    up += math.cos(declination) * math.cos(latitude) * math.cos(h)
    east = -math.cos(declination) * math.sin(h)
    north = math.sin(declination) * math.cos(latitude)
    north -= math.cos(declination) * math.sin(latitude) * math.cos(h)
    return np.array([east, north, up])


@pytest.mark.parametrize("latitude", [-35.0, 9.15, 47.4, 68.0])
@pytest.mark.parametrize("month", [1, 3, 6, 9, 11])
def test_sun_against_the_almanac(latitude, month):
    date = datetime.date(2025, month, 21)
    for hour in (0.5, 6.0, 9.0, 12.0, 17.5):
        elevation, azimuth = np.radians(sun_angles(latitude, date, hour))
        level = math.cos(elevation)
        sun = [level * math.sin(azimuth), level * math.cos(azimuth), math.sin(elevation)]
        apart = math.degrees(math.acos(min(float(almanac(latitude, date, hour) @ sun), 1.0)))
        assert apart < 0.4  # a series of one year against years with and without leap days
