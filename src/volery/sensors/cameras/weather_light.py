"""The light of a day in rain, snow, fog or dust, from that of the same day in clear air.

- Haze: extinctions add up (`world.weather.particles`), so that contrast fades by Koschmieder's law;
  distant objects take the horizon's colour.
- Clouds of rain and snow hide the sun and let through a quarter of all light (Kasten
  and Czeplak 1980: 1 - 0.75 N^3.4, N = 1 for an overcast sky); the sky is then three times as
  bright overhead as at the horizon (Moon and Spencer 1942, the CIE's overcast sky).
- Fog and dust lie in layers on the ground, through which the sun shines with exp(-a h / sin
  elevation); of the light that they scatter, 40 % reaches the ground, and the sky is
  uniform (layers and fraction: modelling choices).
- Rain darkens wet surfaces (explained by Twomey, Bohren and Mergenthaler 1986), here by a third
  (modelling choice). Fallen snow does not settle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.sensors.cameras.light import CLEAR, LAST_DEPTH, Light, make_light
from volery.world.materials import Material
from volery.world.weather import CLEAR_AIR, Particles, Weather
from volery.world.weather.particles import (
    VISIBLE_NM,
    dust_extinction,
    extinction,
    fog_extinction,
)

_FOG_LAYER_M, _DUST_LAYER_M = 100.0, 300.0
"""Thickness of fog and of dust (modelling choice)."""
_PASSED = 0.4
"""Fraction of scattered light that reaches the ground through thick fog or dust (modelling choice).
"""
_LOWEST_SINE = 0.05
"""Minimum sine of the sun's elevation: at dusk the light below a layer comes from the sky."""
_GREY = np.array([1.0, 1.0, 1.0])
_DUSTY = np.array([1.15, 0.98, 0.68])
"""Colour of light that dust scattered, of the same brightness (modelling choice)."""
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Luminance weights of linear sRGB (IEC 61966-2-1)."""
_WET = 2.0 / 3.0
_ABSORBENT = (
    Material.GROUND,
    Material.WOOD,
    Material.WALL,
    Material.FACADE,
    Material.ASPHALT,
    Material.PAVING,
    Material.CLOTHES,
)

Array = NDArray[np.floating[Any]]


class LightOfTheHour:
    """Returns the light in a weather, cached until the weather changes.

    sun_in: returns elevation and azimuth of the sun in a weather, deg. visibility_m: of clear air.
    """

    def __init__(
        self, sun_in: Callable[[Weather], tuple[float, float]], visibility_m: float
    ) -> None:
        self._sun_in = sun_in
        self._visibility_m = visibility_m
        self._made_for: tuple[Particles, float | None] | None = None
        self._light: Light | None = None

    def __call__(self, weather: Weather) -> Light:
        """Returns the light in `weather`."""
        wanted = (weather.particles, weather.hour_of_day)
        if self._light is None or wanted != self._made_for:
            clear = make_light(*self._sun_in(weather), self._visibility_m)
            self._light = light_in(clear, weather.particles)
            self._made_for = wanted
        return self._light


def light_in(clear: Light, particles: Particles) -> Light:
    """Returns the light of a clear day with particles in the air; `clear` itself in clear air."""
    if particles == CLEAR_AIR:
        return clear
    fog, dust = _depths(particles)
    height = max(float(clear.sun[2]), 0.0)
    through = math.exp(-(fog + dust) / max(height, _LOWEST_SINE))
    under_clouds = particles.rain_mm_h > 0.0 or particles.snow_mm_h > 0.0
    passed = (0.25 if under_clouds else 1.0) * (_PASSED + (1.0 - _PASSED) * through)
    direct = 0.0 if under_clouds else through
    sun = clear.sun_colour.astype(float)
    whole = sun * height + clear.overhead
    sky = passed * whole - direct * sun * height
    veiled = 1.0 - direct
    hanging = 1.0 - math.exp(-fog - dust)  # fraction of the sky that fog or dust covers
    colour = _tint(fog, dust)
    overhead = _mixed(sky, _brightness(sky) * colour, veiled)
    zenith = overhead * (9.0 / 7.0 + hanging * (1.0 - 9.0 / 7.0))
    horizon = overhead * (3.0 / 7.0 + hanging * (1.0 - 3.0 / 7.0))
    return clear._replace(
        sun_colour=_row(direct * sun),
        zenith=_row(_mixed(clear.zenith, zenith, veiled)),
        horizon=_row(_mixed(clear.horizon, horizon, veiled)),
        bounce=_row(clear.bounce * passed),
        overhead=_row(overhead),
        clear_per_m=clear.clear_per_m + CLEAR * extinction(particles, VISIBLE_NM) / LAST_DEPTH,
        surface=_wetted(clear.surface) if particles.rain_mm_h > 0.0 else clear.surface,
    )


def _depths(particles: Particles) -> tuple[float, float]:
    """Returns the vertical optical depths of fog and of dust."""
    return (
        fog_extinction(particles.fog_visibility_m) * _FOG_LAYER_M,
        dust_extinction(particles.dust_visibility_m) * _DUST_LAYER_M,
    )


def _tint(fog: float, dust: float) -> Array:
    """Returns the colour of scattered light, of brightness 1: grey but for the fraction of dust."""
    fraction = dust / (fog + dust) if dust > 0.0 else 0.0
    colour: Array = _mixed(_GREY, _DUSTY, fraction)
    return colour / _brightness(colour)


def _brightness(colour: Array) -> float:
    return float(_LUMINANCE @ colour)


def _mixed(a: Array, b: Array, fraction: float) -> Array:
    return a + fraction * (b - a)


def _wetted(surface: NDArray[np.float32]) -> NDArray[np.float32]:
    wet = surface.copy()
    for material in _ABSORBENT:
        wet[material, :6] *= np.float32(_WET)
    return wet


def _row(values: Array) -> NDArray[np.float32]:
    return np.asarray(values, dtype=np.float32)
