"""Particles in the air, and their extinction of light.

Extinction is that of single scattering, the sum of all kinds; a is per metre, the fraction of light
left after r metres is exp(-a r) (Beer and Lambert):

- rain: Marshall and Palmer 1948, drops of diameter D in numbers N0 exp(-s D), N0 = 8000 /m^3/mm,
  s = 4.1 R^-0.21 /mm, each with an extinction of twice its cross-section: a = pi N0 / s^3, that is
  0.365 R^0.63 /km, which is also ITU-R P.1817-1's law of rain (1.58 R^0.63 dB/km, Japan).
- snow: ITU-R P.1817-1, dry snow: (5.42e-5 L + 5.4958776) S^1.38 dB/km, L the wavelength in nm.
- fog: ln(20) / V at 550 nm by the definition of the meteorological optical range V (WMO-No. 8, a
  contrast of 5 %); at other wavelengths times (L / 550)^-q, with q of Kim, McArthur and Korevaar
  2001 (SPIE 4214): 0 in dense fog, Kruse's exponents in haze. Both count visibility by a contrast
  of 2 %, ln(50) / a.
- dust: ln(20) / V at all wavelengths: grains of desert dust are larger than them (Angstrom
  exponents about 0).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from volery.core.errors import CommandError
from volery.scenario.weather import (
    MAX_RAIN_MM_H,
    MAX_SNOW_MM_H,
    MAX_VISIBILITY_M,
    MIN_VISIBILITY_M,
)

VISIBLE_NM = 550.0
_DECIBEL = math.log(10.0) / 10.0
_FAINT = math.log(20.0)
"""Optical depth at which contrast is 5 %, that of the meteorological optical range ..."""
_FAINTER = math.log(50.0)
"""... and 2 %, that of Kruse's and Kim's visibility."""
_DROPS = 8000.0
"""N0 of Marshall and Palmer, /m^3/mm."""
_FLAKE_STRETCH = 10.0 ** (1.0 / 3.0)
"""Diameter of a flake over that of the drop it melts to, at a tenth of water's density (modelling
choice)."""
_MM2 = 1e-6


@dataclass(frozen=True, slots=True)
class Particles:
    """Rain and snow by their rates, fog and dust by the visibility in each alone."""

    rain_mm_h: float = 0.0
    snow_mm_h: float = 0.0
    """Rate of snow as water."""
    fog_visibility_m: float = math.inf
    """Meteorological optical range; inf: none."""
    dust_visibility_m: float = math.inf

    def __post_init__(self) -> None:
        check_range("rain_mm_h", self.rain_mm_h, 0.0, MAX_RAIN_MM_H)
        check_range("snow_mm_h", self.snow_mm_h, 0.0, MAX_SNOW_MM_H)
        for name in ("fog_visibility_m", "dust_visibility_m"):
            value = getattr(self, name)
            if value != math.inf:
                check_range(name, value, MIN_VISIBILITY_M, MAX_VISIBILITY_M)

    @property
    def visibility_m(self) -> float:
        """Meteorological optical range in all particles together; inf without any."""
        whole = extinction(self, VISIBLE_NM)
        return _FAINT / whole if whole > 0.0 else math.inf


def check_range(what: str, value: float, low: float, high: float) -> None:
    """Raises `CommandError` for a value outside of a range."""
    if not low <= value <= high:  # true for NaN
        raise CommandError(f"{what} = {value:g} is out of range; {low:g} to {high:g} is allowed")


CLEAR_AIR = Particles()
"""Air without particles."""


def extinction(particles: Particles, wavelength_nm: float) -> float:
    """Returns the extinction coefficient, 1/m."""
    return (
        rain_extinction(particles.rain_mm_h)
        + snow_extinction(particles.snow_mm_h, wavelength_nm)
        + fog_extinction(particles.fog_visibility_m, wavelength_nm)
        + dust_extinction(particles.dust_visibility_m)
    )


def rain_slope(rain_mm_h: float) -> float:
    """Returns the slope of drop numbers over the diameter, 1/mm (Marshall and Palmer 1948)."""
    return float(4.1 * rain_mm_h**-0.21)


def drop_speed(diameter_mm: float) -> float:
    """Returns the fall speed of a drop, m/s (Atlas, Srivastava and Sekhon 1973, 0.6 to 5.8 mm)."""
    return max(9.65 - 10.3 * math.exp(-0.6 * diameter_mm), 0.1)


def rain_speed(rain_mm_h: float) -> float:
    """Returns the fall speed of the drops with most of the water: of diameter 4 / slope, m/s."""
    return drop_speed(4.0 / rain_slope(rain_mm_h))


def rain_extinction(rain_mm_h: float) -> float:
    """Returns the extinction coefficient of rain at any wavelength, 1/m."""
    if rain_mm_h == 0.0:
        return 0.0
    return math.pi * _DROPS * _MM2 / rain_slope(rain_mm_h) ** 3


def snow_slope(snow_mm_h: float) -> float:
    """Returns the slope of flake numbers over the diameter, 1/mm.

    Gunn and Marshall 1958, melted: 2.55.
    """
    return float(2.55 / _FLAKE_STRETCH * snow_mm_h**-0.48)


def snow_extinction(snow_mm_h: float, wavelength_nm: float = VISIBLE_NM) -> float:
    """Returns the extinction coefficient of dry snow, 1/m."""
    decibel_per_km = (5.42e-5 * wavelength_nm + 5.4958776) * snow_mm_h**1.38
    return float(1e-3 * _DECIBEL * decibel_per_km)


def fog_extinction(visibility_m: float, wavelength_nm: float = VISIBLE_NM) -> float:
    """Returns the extinction coefficient of fog or haze, 1/m."""
    green = _FAINT / visibility_m
    if green == 0.0:
        return 0.0
    exponent = _kim_exponent(1e-3 * _FAINTER / green)
    return float(green * (wavelength_nm / VISIBLE_NM) ** -exponent)


def _kim_exponent(visibility_km: float) -> float:
    if visibility_km > 50.0:
        return 1.6
    if visibility_km > 6.0:
        return 1.3
    if visibility_km > 1.0:
        return 0.16 * visibility_km + 0.34
    return max(visibility_km - 0.5, 0.0)


def dust_extinction(visibility_m: float) -> float:
    """Returns the extinction coefficient of dust at any wavelength, 1/m."""
    return _FAINT / visibility_m


def number_per_mm(extinction_per_m: float, slope_per_mm: float) -> float:
    """Returns N0 of particles N0 exp(-slope D), /m^3/mm, with that extinction; Q = 2."""
    return extinction_per_m * slope_per_mm**3 / (math.pi * _MM2)
